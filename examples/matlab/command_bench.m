function command_bench()
% Command the bench from MATLAB over its JSON-RPC socket.
%
% Start a bench first (smad start --sim). ZeroMQ comes from Python here: pyenv has to name a Python
% with pyzmq, such as the one that smad is installed in. Every request is described by
% smad/commands.schema.json and in docs/guide/clients.md.

% Of a daemon that systemd runs, the folder is /run/smad; without XDG_RUNTIME_DIR, /tmp/smad-UID.
folder = fullfile(getenv('XDG_RUNTIME_DIR'), 'smad');
connection = jsondecode(fileread(fullfile(folder, 'bench.json')));
context = py.zmq.Context();
commands = dealer(context, connection.command);
stops = dealer(context, connection.stop);

show(ask(commands, '{"jsonrpc": "2.0", "id": 1, "method": "status"}'));

% Whatever ends this function, ctrl-C or an error too, stops the bench. Stops have their own socket.
% If MATLAB itself is killed, the bench stays armed, unless daemon.dead_man_lease_s is configured.
stop = onCleanup(@() ask(stops, '{"jsonrpc": "2.0", "id": 2, "method": "disarm"}'));
ask(commands, '{"jsonrpc": "2.0", "id": 3, "method": "arm"}');
ask(commands, '{"jsonrpc": "2.0", "id": 4, "method": "record.start", "params": {"name": "matlab"}}');
ask(commands, ['{"jsonrpc": "2.0", "id": 5, "method": "move", "params": {"trajectories": [' ...
    '{"kind": "ramp", "displacement_mm": 2.0, "rate_mm_per_s": 2.0}, ' ...
    '{"kind": "hold", "duration_s": 1.0}]}}']);

motion.done = false;
while ~motion.done
    pause(0.1);
    motion = ask(commands, '{"jsonrpc": "2.0", "id": 6, "method": "motion"}');
    fprintf('%.2f mm\n', motion.displacement_mm);
    if ~motion.armed
        error('the bench was stopped: see smad status');
    end
end
ask(commands, '{"jsonrpc": "2.0", "id": 7, "method": "record.stop"}');
end

function socket = dealer(context, address)
socket = context.socket(py.zmq.DEALER);
socket.connect(address);
end

function result = ask(socket, text)
socket.send_string(text);
if ~socket.poll(int32(5000))
    error('no reply in 5 s; the command may have been carried out: see smad status');
end
reply = jsondecode(char(socket.recv_string()));
if isfield(reply, 'error')
    error('%s', reply.error.message);
end
result = reply.result;
end

function show(status)
fprintf('%s: board in %s\n', status.bench, status.motion.mode);
end
