"""What each mode asks for, sample by sample. The controller owns limits, time and mode changes.

`name` is what telemetry and run log call it; `done` says whether it has ended by itself; `step`
gives what the board is to apply, before host limits.
"""

import math

from smad.config import ControlConfig, LimitsConfig, TemperatureConfig
from smad.control.commands import DriveCurrent, Follow, HoldTemperature, Tune
from smad.control.cooling import Pump, Switch
from smad.control.feedforward import Anticipation
from smad.control.hold import Direction, PairTemperatureControl, QuietHold
from smad.control.pi import PI
from smad.control.sample import LONGEST_STEP_S, Sample
from smad.control.setpoint import Output
from smad.control.trajectories import ReferenceQueue


class IdleMode:
    """No current, no water."""

    name = "idle"
    done = True

    def step(self, sample: Sample, dt_s: float) -> Output:
        return Output()


class DisplacementMode:
    """PI on displacement: positive output heats X and cools Y, negative the other way round."""

    name = "displacement"

    def __init__(self, config: ControlConfig, limits: LimitsConfig) -> None:
        limit_A = config.current_limit_A
        self._pi = PI(
            config.kp_A_per_mm * 1e3,
            config.ki_A_per_mm_s * 1e3,
            -limit_A,
            limit_A,
            config.anti_windup_time_s,
        )
        self._largest_A = limit_A
        self._limit_A = limit_A
        self._pumps = (Pump(config.cooling), Pump(config.cooling))
        self._hold = QuietHold(config.hold)
        self._direction = Direction(
            config.hold.reversal_A, config.hold.reversal_smooth_s, config.cooling.urgent_A
        )
        self._config = config
        self._pair: PairTemperatureControl | None = None
        self._turned = False
        self._urgent_A = config.cooling.urgent_A
        self._u_A = 0.0
        self._queue = ReferenceQueue(limits, config.handover_rate_mm_per_s)
        self._anticipation = Anticipation(config.feedforward, limit_A)
        self._anticipate = config.feedforward.enabled
        self._drain = config.drain_before_heating
        self._drained = (False, False)

    @property
    def done(self) -> bool:
        return self._queue.done

    @property
    def reference_m(self) -> float:
        return self._queue.reference_m

    def tune(self, command: Tune) -> None:
        """Take the fields of `command` that are not empty."""
        pi = self._pi
        if command.ki_A_per_mm_s is not None:
            pi.ki = command.ki_A_per_mm_s * 1e3
        if command.kp_A_per_mm is not None:
            pi.retune(command.kp_A_per_mm * 1e3)
        if command.hold_band_mm is not None:
            self._hold.band_m = command.hold_band_mm * 1e-3
        if command.current_limit_A is not None:
            self._limit_A = min(self._largest_A, command.current_limit_A)
            self._anticipation.current_A = self._limit_A
        if command.cooling is not None:
            for pump in self._pumps:
                pump.mode = command.cooling
        if command.feedforward is not None:
            self._anticipate = command.feedforward
        if command.drain_before_heating is not None:
            self._drain = command.drain_before_heating

    def enter(self, sample: Sample | None, u_now_A: float) -> None:
        """Take over without a bump: stand where the pair stands, drive as it is driven."""
        self._queue.restart(0.0 if sample is None else sample.displacement_m)
        self._bound(0)
        self._pi.preset(u_now_A)
        self._u_A = u_now_A
        self._hold.reset()
        self._direction.reset(u_now_A)
        self._anticipation.reset()

    def check(self, command: Follow, at_m: float) -> None:
        """Raise CommandError for what cannot be followed from `at_m`."""
        self._queue.compiled(command, at_m)

    def follow(self, command: Follow) -> None:
        self._queue.follow(command)

    def step(self, sample: Sample, dt_s: float) -> Output:
        queue, hold = self._queue, self._hold
        error_m = queue.advance(dt_s) - sample.displacement_m
        if math.isnan(error_m):
            # No displacement, no feedback: better cold than blind.
            self._still()
            return Output()
        dt_s = min(dt_s, LONGEST_STEP_S)
        was_quiet = hold.quiet
        followed_m = hold.step(queue.reference_m, error_m, dt_s)
        push_A, forced = 0.0, 0
        if self._anticipate:
            advice = self._anticipation.step(queue.peek, sample, self._drained, dt_s)
            if not hold.near:
                forced = advice.direction
                followed_m = queue.peek(advice.lead_s) - sample.displacement_m
                push_A = forced * self._limit_A if advice.push else 0.0
        if hold.quiet:
            if not was_quiet:
                self._pair = None
                self._turned = False
                self._pi.preset(self._u_A, followed_m)
            return self._hold_still(followed_m, sample, dt_s)
        self._bound(forced)
        self._u_A = self._pi.step(followed_m, dt_s, push_A)
        direction = self._direction.step(self._u_A, dt_s, forced)
        return self._split(direction, dt_s, sudden=forced != 0)

    def _hold_still(self, followed_m: float, sample: Sample, dt_s: float) -> Output:
        """The two parts of a quiet hold: arrive with one spring, then keep both as they are."""
        pi, config, before = self._pi, self._config, self._direction.sign
        warm_degC = (sample.rtd_degC[0], sample.rtd_degC[1])
        blind = math.isnan(sum(warm_degC))
        if blind:
            self._pair = None
        if self._pair is None:
            # The error alone decides: what flows in the spring to be let go would delay it.
            direction = self._direction.step(pi.kp * followed_m, dt_s)
            self._turned = self._turned or direction != before
            # Not before the error is small: an error that is kept stays for as long as a
            # temperature takes through its hysteresis.
            near = abs(followed_m) <= 0.5 * self._hold.band_m
            if blind or not (near and (self._hold.arrived or self._turned)):
                return self._arrive(followed_m, direction, before, dt_s)
            self._pair = PairTemperatureControl(
                config.hold,
                self._limit_A,
                config.anti_windup_time_s,
                warm_degC=warm_degC,
                now_A=self._u_A,
                error_m=followed_m,
            )
        i_A = self._pair.step(followed_m, warm_degC, dt_s)
        # What goes on when the quiet ends.
        self._u_A = i_A[0] - i_A[1]
        pi.preset(self._u_A, followed_m)
        self._direction.reset(self._u_A)
        applied_A = [*i_A]
        duty = self._water(applied_A, [0.0, 0.0], dt_s)
        return Output((applied_A[0], applied_A[1]), duty, self._drained)

    def _arrive(self, followed_m: float, direction: int, before: int, dt_s: float) -> Output:
        """One spring pulls, with less and less current."""
        pi = self._pi
        if direction != before:
            pi.integral = 0.0
        pi.integral *= math.exp(-dt_s / self._config.hold.ease_s)
        self._bound(direction)
        self._u_A = pi.step(followed_m, dt_s)
        return self._split(direction, dt_s)

    def _split(self, direction: int, dt_s: float, *, sudden: bool = False) -> Output:
        """Current for the spring that pulls, water for the other."""
        pulling = 0 if direction > 0 else 1
        i_A, water_A = [0.0, 0.0], [0.0, 0.0]
        i_A[pulling] = current_A = max(0.0, self._u_A * direction)
        if not self._hold.near:
            smooth_A = self._direction.demand_A * direction
            urgent = current_A >= self._urgent_A
            water_A[1 - pulling] = current_A if urgent else min(current_A, smooth_A)
        duty = self._water(i_A, water_A, dt_s, sudden=sudden)
        self._drained = (self._drain and i_A[0] > 0.0, self._drain and i_A[1] > 0.0)
        return Output((i_A[0], i_A[1]), duty, self._drained)

    def _water(
        self, i_A: list[float], water_A: list[float], dt_s: float, *, sudden: bool = False
    ) -> tuple[float, float]:
        """Duties for what is asked of the other spring; where water runs, heat waits (`i_A`)."""
        duty = [0.0, 0.0]
        for k, pump in enumerate(self._pumps):
            duty[k] = pump.step(water_A[k], i_A[k], dt_s, sudden=sudden)
            if pump.running:
                i_A[k] = 0.0
        return duty[0], duty[1]

    def _still(self) -> None:
        for pump in self._pumps:
            pump.stop()
        self._hold.reset()

    def _bound(self, direction: int) -> None:
        """Let the output heat X (+1), Y (-1), or either (0)."""
        self._pi.high = self._limit_A if direction >= 0 else 0.0
        self._pi.low = -self._limit_A if direction <= 0 else 0.0


class TemperatureMode:
    """PI on the temperature of one spring, with its own pump when it is too warm."""

    name = "temperature"

    def __init__(
        self,
        config: ControlConfig,
        gains: TemperatureConfig,
        command: HoldTemperature,
        spring_degC: float,
    ) -> None:
        self._spring = 0 if command.spring == "x" else 1
        self._command = command
        self._pi = PI(
            gains.kp_A_per_K,
            gains.ki_A_per_K_s,
            0.0,
            config.current_limit_A,
            config.anti_windup_time_s,
        )
        self._water = Switch(
            gains.pump_above_K, 0.0, config.cooling.min_on_s, config.cooling.min_off_s
        )
        self._duty = config.cooling.switch_duty
        ramped = command.rate_K_per_s is not None and not math.isnan(spring_degC)
        self.target_degC = spring_degC if ramped else command.temperature_degC
        self._held_s = 0.0
        self.done = False

    def enter(self, spring_degC: float, i_now_A: float) -> None:
        """Go on with the current that flows now (bumpless)."""
        if not math.isnan(spring_degC):
            self._pi.preset(i_now_A, self.target_degC - spring_degC)

    def step(self, sample: Sample, dt_s: float) -> Output:
        self._move_target(dt_s)
        rtd_degC = sample.rtd_degC[self._spring]
        if math.isnan(rtd_degC):
            return Output()
        error_K = self.target_degC - rtd_degC
        i_A = self._pi.step(error_K, min(dt_s, LONGEST_STEP_S))
        duty = 0.0
        if i_A > 0.0:
            self._water.stop()
        elif self._command.use_water and self._water.step(-error_K, dt_s):
            duty = self._duty
        if self._spring == 0:
            return Output((i_A, 0.0), (duty, 0.0))
        return Output((0.0, i_A), (0.0, duty))

    def _move_target(self, dt_s: float) -> None:
        command = self._command
        gap_K = command.temperature_degC - self.target_degC
        if gap_K != 0.0 and command.rate_K_per_s is not None:
            step_K = command.rate_K_per_s * dt_s
            self.target_degC += math.copysign(min(step_K, abs(gap_K)), gap_K)
            return
        self._held_s += dt_s
        if command.duration_s is not None and self._held_s >= command.duration_s:
            self.done = True


class CurrentMode:
    """Plain currents and duties until the time is over or a temperature is reached."""

    name = "current"

    def __init__(self, command: DriveCurrent) -> None:
        self._command = command
        self._watched = 0 if command.stop_spring == "x" else 1
        self._output = Output(
            (command.i_x_A, command.i_y_A),
            (command.pump_x_duty, command.pump_y_duty),
            (command.drain_x, command.drain_y),
        )
        self._elapsed_s = 0.0
        self.done = False

    def step(self, sample: Sample, dt_s: float) -> Output:
        command = self._command
        self._elapsed_s += dt_s
        rtd_degC = sample.rtd_degC[self._watched]
        if (
            (command.duration_s is not None and self._elapsed_s >= command.duration_s)
            or (command.stop_above_degC is not None and rtd_degC >= command.stop_above_degC)
            or (command.stop_below_degC is not None and rtd_degC <= command.stop_below_degC)
        ):
            self.done = True
        return Output() if self.done else self._output
