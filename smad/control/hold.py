"""A quiet hold: what the displacement loop does once it is where it should be.

The pair stands by itself while the temperatures of both springs stay within their hysteresis, some
kelvin wide. At either end of it the displacement moves at once, by some tenths of a millimetre for
each kelvin. A loop that heats one spring at a time lets the other cool through its hysteresis
meanwhile, and turns to it when it gives way; then the first one cools. That is the limit cycle of a
hold.

So once the reference rests and the error is small, no water flows, an error within the band is
none, and the hold has two parts. On arrival the spring that pulls is heated as before, with an
integral that fades, so that a warm spring comes down to where it just holds. After that, or once
the other spring was needed, `PairTemperatureControl` keeps both at the temperatures that they have
when the error is small: temperature is under control also where the displacement says nothing.
"""

import math

from smad.config import HoldConfig
from smad.control.pi import PI

KEPT_REACH_K = 1.0
"""A kept temperature is at most so far from the spring's own: a spring without current cannot be
cooled further, and is not to wait for a temperature that ran ahead of it."""


class QuietHold:
    """Says whether the hold is quiet, and which error is to be followed then."""

    __slots__ = ("_config", "_inside_s", "_reference_m", "_smooth_m", "band_m", "near", "quiet")

    def __init__(self, config: HoldConfig) -> None:
        self._config = config
        self.band_m = config.band_mm * 1e-3
        self.reset()

    def reset(self) -> None:
        """Begin as after a move."""
        self.quiet = False
        """Whether the error has been small for long enough."""
        self.near = False
        """Whether the reference rests and the error is within some bands: no case for water."""
        self._reference_m = math.nan
        self._smooth_m = 0.0
        self._inside_s = 0.0

    @property
    def arrived(self) -> bool:
        """Whether it has been quiet for so long that the springs are to stay as they are."""
        return self._inside_s >= self._config.settled_s + self._config.arrive_s

    def step(self, reference_m: float, error_m: float, dt_s: float) -> float:
        """The error to follow, m: all of it, or in the quiet what lies beyond the band."""
        config = self._config
        if reference_m != self._reference_m:
            self.reset()
            self._reference_m = reference_m
            self._smooth_m = error_m
            return error_m
        smooth_m = self._smooth_m = self._smooth_m + (error_m - self._smooth_m) * dt_s / (
            config.smooth_s + dt_s
        )
        within = config.near_bands * (2.0 if self.quiet else 1.0)
        self.near = abs(smooth_m) < within * self.band_m
        self._inside_s = self._inside_s + dt_s if self.near else 0.0
        self.quiet = self._inside_s >= config.settled_s
        if not self.quiet:
            return error_m
        half_m = 0.5 * self.band_m
        return smooth_m - min(half_m, max(-half_m, smooth_m))


class PairTemperatureControl:
    """Both springs at temperatures, which the error moves apart: PI on each, without water.

    Begins with the temperatures and the signed current `now_A` of the moment, bumpless at the error
    `error_m`. Temperatures in °C and currents in A are pairs (x, y).
    """

    __slots__ = ("_config", "_kept_degC", "_loops", "_warm_degC")

    def __init__(
        self,
        config: HoldConfig,
        limit_A: float,
        anti_windup_time_s: float,
        *,
        warm_degC: tuple[float, float],
        now_A: float,
        error_m: float,
    ) -> None:
        self._config = config
        self._warm_degC = list(warm_degC)
        self._kept_degC = list(warm_degC)
        self._loops = [
            PI(config.kept_A_per_K, config.kept_A_per_K_s, 0.0, limit_A, anti_windup_time_s)
            for _ in warm_degC
        ]
        for loop, sign in zip(self._loops, (1.0, -1.0), strict=True):
            loop.preset(max(0.0, sign * now_A), sign * config.kept_K_per_mm * 1e3 * error_m)

    def step(
        self, error_m: float, warm_degC: tuple[float, float], dt_s: float
    ) -> tuple[float, float]:
        """The currents `dt_s` seconds later, for the error to follow and measured temperatures."""
        config = self._config
        apart_K = config.kept_K_per_mm * 1e3 * error_m
        change_K = config.kept_K_per_mm_s * 1e3 * error_m * dt_s
        i_A = [0.0, 0.0]
        for k, sign in ((0, 1.0), (1, -1.0)):
            smooth_degC = self._warm_degC[k]
            smooth_degC += (warm_degC[k] - smooth_degC) * dt_s / (config.smooth_s + dt_s)
            self._warm_degC[k] = smooth_degC
            kept_degC = self._kept_degC[k] + sign * change_K
            kept_degC = min(smooth_degC + KEPT_REACH_K, max(smooth_degC - KEPT_REACH_K, kept_degC))
            self._kept_degC[k] = kept_degC
            i_A[k] = self._loops[k].step(kept_degC + sign * apart_K - smooth_degC, dt_s)
        return i_A[0], i_A[1]


class Direction:
    """Which spring the signed demand may heat: +1 for X, -1 for Y.

    It turns when the smoothed demand asks for the other spring by more than a threshold, so that
    noise about zero does not heat both.
    """

    __slots__ = ("_at_once_A", "_over_A", "_smooth_s", "demand_A", "sign")

    def __init__(self, over_A: float, smooth_s: float, at_once_A: float) -> None:
        self._over_A = over_A
        self._at_once_A = at_once_A
        self._smooth_s = smooth_s
        self.reset(0.0)

    def reset(self, demand_A: float) -> None:
        """Begin with a demand that flows."""
        self.demand_A = demand_A
        self.sign = 1 if demand_A >= 0.0 else -1

    def step(self, demand_A: float, dt_s: float, forced: int = 0) -> int:
        """The direction for the demand, A; `forced` decides when it is not 0."""
        self.demand_A += (demand_A - self.demand_A) * dt_s / (self._smooth_s + dt_s)
        if forced:
            self.sign = forced
        elif demand_A * self.sign < -self._at_once_A:
            # What was smoothed is of the old direction, and would turn it back.
            self.demand_A = demand_A
            self.sign = -self.sign
        elif self.demand_A * self.sign < -self._over_A:
            self.sign = -self.sign
        return self.sign
