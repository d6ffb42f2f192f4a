"""What the host refuses to exceed, whatever the mode asks for. Tighter than the board's limits."""

import enum
import math
from dataclasses import dataclass

from smad.config import LimitsConfig
from smad.control.sample import LONGEST_STEP_S, Sample

FOLD_BACK_K = 2.0
"""Over so many kelvin below the temperature limit the current limit falls to zero: a spring at
the limit gets a steady current instead of a switched one."""
FOLD_BACK_A = 4.0
"""What is allowed where the fold-back begins: the paper's largest current."""
RATE_WINDOW_S = 0.05
"""A temperature rate is taken over at least this time: sample to sample it would be noise."""
QUENCH = 4.0
"""Water cools a wire so many times faster than current heats it: 20 W/(m K) across 10 K against 30
W/m. A sensor that falls faster still is broken."""


class HostLimit(enum.IntFlag):
    """Which host limits act."""

    NONE = 0
    TEMPERATURE_X = 1
    TEMPERATURE_Y = 2
    SENSOR_X = 4
    SENSOR_Y = 8
    DISPLACEMENT = 16
    FORCE = 32
    ON_TIME = 64
    CURRENT_RATE = 128


@dataclass(frozen=True)
class Trip:
    """A limit that ended a motion until the next arming.

    `measured` and `allowed` are in s for ON_TIME and in K/s for a sensor, whose reading at that
    moment is `rtd_degC`.
    """

    limit: HostLimit
    measured: float
    allowed: float
    rtd_degC: float = math.nan


_TEMPERATURE = (HostLimit.TEMPERATURE_X, HostLimit.TEMPERATURE_Y)
_SENSOR = (HostLimit.SENSOR_X, HostLimit.SENSOR_Y)


class _SensorWatch:
    """Trips on a temperature that changes faster than a spring can."""

    __slots__ = ("_for_s", "_from_degC", "_limit", "trip")

    def __init__(self, limit: HostLimit) -> None:
        self.trip: Trip | None = None
        self._limit = limit
        self._from_degC = math.nan
        self._for_s = 0.0

    def step(self, rtd_degC: float, dt_s: float, rate_max_K_per_s: float) -> None:
        self._for_s += dt_s
        if self._for_s < RATE_WINDOW_S:
            return
        # A comparison with nan is false: the first window after an invalid reading cannot trip.
        change_K = rtd_degC - self._from_degC
        most_K = rate_max_K_per_s * self._for_s
        allowed = rate_max_K_per_s if change_K > 0.0 else -QUENCH * rate_max_K_per_s
        tripped = change_K > most_K or change_K < -QUENCH * most_K
        if tripped and self.trip is None:
            self.trip = Trip(self._limit, change_K / self._for_s, allowed, rtd_degC)
        self._from_degC = rtd_degC
        self._for_s = 0.0


class HostLimits:
    """Takes the wanted currents and gives the allowed ones; `acting` says what held them back.

    A tripped sensor and an elapsed on-time stay until `rearm`. The first of them that held a
    current back, or would have, is `trip`: what was commanded must not go on without it.
    """

    def __init__(self, config: LimitsConfig) -> None:
        self._config = config
        self._acting = 0
        self.rearm()

    @property
    def acting(self) -> HostLimit:
        """What held the last currents back."""
        return HostLimit(self._acting)

    def rearm(self) -> None:
        """Start anew, as after an arming: the on-time at zero, no sensor tripped."""
        self.trip: Trip | None = None
        self._on_time_s = 0.0
        self._watch = (_SensorWatch(_SENSOR[0]), _SensorWatch(_SENSOR[1]))
        self._previous_A = [0.0, 0.0]

    def apply(
        self, sample: Sample, i_x_A: float, i_y_A: float, dt_s: float, *, staged: bool = False
    ) -> tuple[float, float]:
        """The currents (x, y) that may flow, A.

        With `staged` the displacement is the stage's doing, and no current is cut for it.
        """
        config = self._config
        acting = 0
        limited_A = [i_x_A, i_y_A]
        self._on_time_s += dt_s
        if self._on_time_s > config.on_time_max_s:
            acting |= HostLimit.ON_TIME
            limited_A[0] = limited_A[1] = 0.0
            if self.trip is None:
                self.trip = Trip(HostLimit.ON_TIME, self._on_time_s, config.on_time_max_s)
        # A bench without a force sensor reads nan, which no comparison stops.
        if sample.force_N > config.force_max_N:
            acting |= HostLimit.FORCE
            limited_A[0] = limited_A[1] = 0.0
        reach_m = config.displacement_max_mm * 1e-3
        if abs(sample.displacement_m) > reach_m and not staged:
            pulling = 0 if sample.displacement_m > 0.0 else 1
            if limited_A[pulling] > 0.0:
                acting |= HostLimit.DISPLACEMENT
                limited_A[pulling] = 0.0
        for k in (0, 1):
            acting |= self._spring(k, sample.rtd_degC[k], limited_A, dt_s)
        if self.trip is not None:
            acting |= self.trip.limit.value
        self._previous_A = limited_A
        self._acting = acting
        return limited_A[0], limited_A[1]

    def _spring(self, k: int, rtd_degC: float, limited_A: list[float], dt_s: float) -> int:
        config = self._config
        watch = self._watch[k]
        watch.step(rtd_degC, dt_s, config.temperature_rate_max_K_per_s)
        i_A = limited_A[k]
        if i_A <= 0.0:
            return 0
        if watch.trip is not None or math.isnan(rtd_degC):
            limited_A[k] = 0.0
            if self.trip is None:
                self.trip = watch.trip
            return _SENSOR[k].value
        acting = 0
        room_K = config.temperature_max_degC - rtd_degC
        if room_K < FOLD_BACK_K:
            allowed_A = max(0.0, room_K / FOLD_BACK_K) * FOLD_BACK_A
            if i_A > allowed_A:
                i_A = allowed_A
                acting = _TEMPERATURE[k].value
        rise_A = self._previous_A[k] + config.current_rate_max_A_per_s * min(dt_s, LONGEST_STEP_S)
        if i_A > rise_A:
            i_A = rise_A
            acting |= HostLimit.CURRENT_RATE.value
        limited_A[k] = i_A
        return acting
