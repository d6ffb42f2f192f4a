"""The controller of one axis: one step for each sample, in any mode, within the host limits."""

import msgspec

from smad.config import ControlConfig, LimitsConfig
from smad.control.commands import (
    DriveCurrent,
    Follow,
    FollowInputs,
    HoldTemperature,
    Idle,
    ModeCommand,
    MoveStage,
    Tune,
    checked,
)
from smad.control.inforce import tune_of, tuned
from smad.control.inputs import Departure, InputsMode
from smad.control.limits import HostLimit, HostLimits, Trip
from smad.control.modes import (
    CurrentMode,
    DisplacementMode,
    IdleMode,
    TemperatureMode,
)
from smad.control.sample import LONGEST_STEP_S, Sample
from smad.control.setpoint import Output
from smad.errors import CommandError

Mode = IdleMode | DisplacementMode | TemperatureMode | CurrentMode | InputsMode


class Controller:
    """Turns samples into outputs.

    `command` may be called at any time between two steps and takes effect with the next; a refused
    command changes nothing. While the board is not armed nothing is driven; when it leaves ARMED
    the mode ends, so that nothing moves by itself after the next arming. A limit that stays
    (`trip`) ends the mode too, and nothing is driven until the next arming.
    """

    def __init__(self, config: ControlConfig, limits: LimitsConfig | None = None) -> None:
        self._config = config
        self.gains = tune_of(config)
        """The gains and options in force: the configured ones, and what was tuned since."""
        self.departure: Departure | None = None
        """The reading that ended repeated inputs, until the next motion; None if none did."""
        self._limits_config = limits or LimitsConfig()
        self._limits = HostLimits(self._limits_config)
        self._displacement = DisplacementMode(config, self._limits_config)
        self._mode: Mode = IdleMode()
        self._stage = _Stage()
        self._sample: Sample | None = None
        self._armed = False
        self._output = Output()

    @property
    def mode(self) -> str:
        """Name of the mode that runs: idle, displacement, temperature, current or inputs."""
        return self._mode.name

    @property
    def done(self) -> bool:
        """Whether what was commanded has ended: trajectories, time, ramp of the stage."""
        return self._mode.done and self._stage.done

    @property
    def reference_m(self) -> float:
        """The displacement that is followed; nan when none is."""
        return self._displacement.reference_m if self._mode is self._displacement else float("nan")

    @property
    def target_degC(self) -> float:
        """The temperature that is held; nan when none is."""
        mode = self._mode
        return mode.target_degC if isinstance(mode, TemperatureMode) else float("nan")

    @property
    def limiting(self) -> HostLimit:
        """Which host limits held the last output back."""
        return self._limits.acting

    @property
    def trip(self) -> Trip | None:
        """The host limit that ended the motion, until the next arming; None if none did."""
        return self._limits.trip

    def command(self, command: ModeCommand) -> None:
        """Take a command. Raises CommandError, naming field, value and limit, and changing nothing.

        The mode that runs hands over without a bump: the current that flows is the current that the
        new mode starts from, unless its error alone asks for more than the integral can take away.
        A displacement reference starts at the measured displacement.
        """
        command = checked(command)
        match command:
            case Idle():
                self._mode = IdleMode()
                self._stage.stop()
            case Follow():
                self._follow(command)
            case HoldTemperature():
                self._hold_temperature(command)
            case DriveCurrent():
                self._drive_current(command)
            case FollowInputs():
                self._follow_inputs(command)
            case MoveStage():
                sample = self._sample
                self._stage.move(command, 0.0 if sample is None else sample.displacement_m)
            case Tune():
                self.gains = tuned(self.gains, command, most_A=self._config.current_limit_A)
                self._displacement.tune(self.gains)
        if not isinstance(command, Tune | Idle):
            self.departure = None

    def check(self, command: Follow) -> None:
        """Raise the CommandError that `command` would for these trajectories; changes nothing."""
        checked(command)
        mode, sample = self._displacement, self._sample
        here_m = 0.0 if sample is None else sample.displacement_m
        mode.check(command, mode.reference_m if self._mode is mode else here_m)

    def step(self, sample: Sample) -> Output:
        """The output for `sample`. A sample that brings no new time gives the last output again."""
        dt_s = self._elapsed(sample)
        if dt_s <= 0.0:
            return self._output
        if not sample.armed:
            self._disarm()
            return self._output
        if not self._armed:
            self._armed = True
            self._limits.rearm()
        wanted = self._mode.step(sample, dt_s)
        mode = self._mode
        if mode.done and isinstance(mode, CurrentMode | InputsMode):
            if isinstance(mode, InputsMode):
                self.departure = mode.departure
            self._mode = IdleMode()
        i_A = self._limits.apply(sample, *wanted.i_A, dt_s, staged=self._stage.in_use)
        if self._limits.trip is not None:
            return self._stop()
        stage_m = self._stage.step(min(dt_s, LONGEST_STEP_S))
        self._output = Output(i_A, wanted.pump_duty, wanted.drain, stage_m)
        return self._output

    def _elapsed(self, sample: Sample) -> float:
        previous, self._sample = self._sample, sample
        if previous is None:
            return 1e-6
        return (sample.t_us - previous.t_us) * 1e-6

    def _stop(self) -> Output:
        # Held at zero without a word, a motion would seem to go on.
        self._mode = IdleMode()
        self._stage.stop()
        self._output = Output(stage_m=self._stage.step(0.0))
        return self._output

    def _disarm(self) -> None:
        if self._armed:
            self._armed = False
            self._mode = IdleMode()
            self._stage.stop()
            self._stage.in_use = False
        self._output = Output()

    def _follow(self, command: Follow) -> None:
        mode = self._displacement
        if self._mode is not mode:
            i_x_A, i_y_A = self._output.i_A
            mode.enter(self._sample, i_x_A - i_y_A)
        mode.follow(command)
        self._mode = mode

    def _drive_current(self, command: DriveCurrent) -> None:
        limit_A = self._config.current_limit_A
        for spring, current_A in (("X", command.i_x_A), ("Y", command.i_y_A)):
            if current_A > limit_A:
                raise CommandError(
                    f"the current in spring {spring} is above the host's limit",
                    value=f"{current_A:g} A",
                    limit=f"up to {limit_A:g} A (control.current_limit_A)",
                    action="ask for less, or raise the limit in the configuration",
                )
        self._mode = CurrentMode(command)

    def _follow_inputs(self, command: FollowInputs) -> None:
        mode = self._mode
        if not command.queue or not isinstance(mode, InputsMode):
            if command.queue:
                raise CommandError(
                    "there are no inputs to go on from",
                    value=f"mode {mode.name}",
                    action="begin anew: what was queued before has ended or was stopped",
                )
            mode = InputsMode(self._config.repeat, self._config.current_limit_A)
        mode.follow(command)
        self._mode = mode

    def _hold_temperature(self, command: HoldTemperature) -> None:
        limit_degC = self._limits_config.temperature_max_degC
        if command.temperature_degC > limit_degC:
            raise CommandError(
                "the temperature is above the host's limit",
                value=f"{command.temperature_degC:g} °C",
                limit=f"up to {limit_degC:g} °C (limits.temperature_max_degC)",
                action="ask for less, or raise the limit in the configuration",
            )
        k = 0 if command.spring == "x" else 1
        spring_degC = float("nan") if self._sample is None else self._sample.rtd_degC[k]
        warm = msgspec.structs.replace(
            self._config.temperature,
            kp_A_per_K=self.gains.temperature_kp_A_per_K,
            ki_A_per_K_s=self.gains.temperature_ki_A_per_K_s,
        )
        mode = TemperatureMode(self._config, warm, command, spring_degC)
        mode.enter(spring_degC, self._output.i_A[k])
        self._mode = mode


class _Stage:
    """A ramp of the stretching stage; unmoved, it asks for nothing.

    The first one begins at the measured displacement, which is the stage's: it may have been moved
    before this daemon began. Without a reading it begins at 0.
    `in_use`: moved since the last arming. Before the next one the springs may be mounted anew.
    """

    def __init__(self) -> None:
        self.in_use = False
        self._at_m: float | None = None
        self._to_m = 0.0
        self._rate_m_per_s = 0.0

    @property
    def done(self) -> bool:
        return self._at_m is None or self._at_m == self._to_m

    def move(self, command: MoveStage, displacement_m: float) -> None:
        self.in_use = True
        self._to_m = command.stage_mm * 1e-3
        self._rate_m_per_s = command.rate_mm_per_s * 1e-3
        if self._at_m is None:
            self._at_m = displacement_m if displacement_m > 0.0 else 0.0

    def stop(self) -> None:
        if self._at_m is not None:
            self._to_m = self._at_m

    def step(self, dt_s: float) -> float | None:
        if self._at_m is None or self._at_m == self._to_m:
            return self._at_m
        gap_m = self._to_m - self._at_m
        step_m = self._rate_m_per_s * dt_s
        if abs(gap_m) <= step_m:
            self._at_m = self._to_m
        else:
            self._at_m += step_m if gap_m > 0.0 else -step_m
        return self._at_m
