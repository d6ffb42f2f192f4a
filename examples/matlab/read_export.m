% Read a run that smad exported for MATLAB or GNU Octave, and plot it.
%
% Beforehand, in a terminal:  smad log export runs/20261120-050709-step.mcap -o run.mat

loaded = load('run.mat');
run = loaded.run;
t = run.columns.t_s - run.columns.t_s(1);

% Channels that were never recorded are left out; NaN (-1 in whole numbers) marks a missing value.
disp(fieldnames(run.columns));
fprintf('temperature in %s\n', run.units.rtd_x_degC);

% Names of the numbers in mode and limiter.
words = containers.Map(run.legends.mode.numbers, run.legends.mode.words);
fprintf('the board was %s at the end\n', words(double(run.columns.mode(end))));
armed = run.legends.mode.numbers(strcmp(run.legends.mode.words, 'ARMED'));
moving = run.columns.mode == armed;

subplot(2, 1, 1);
plot(t(moving), run.columns.reference_mm(moving), '--', t(moving), run.columns.displacement_mm(moving));
ylabel('displacement (mm)');
legend('reference', 'measured');
subplot(2, 1, 2);
plot(t, run.columns.rtd_x_degC, t, run.columns.rtd_y_degC);
ylabel('temperature (°C)');
xlabel('time (s)');
legend('spring X', 'spring Y');

% Commands, faults, arming and notes.
events = jsondecode(run.events);
for k = 1:numel(events)
    if iscell(events), event = events{k}; else, event = events(k); end
    fprintf('%-8s %s\n', event.kind, event.text);
end
