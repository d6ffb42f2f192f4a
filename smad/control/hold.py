"""A quiet hold: what the displacement loop does once it is where it should be.

The pair stands by itself while the temperature of the spring that pulls stays within its
hysteresis, some kelvin wide. At either end of it the displacement moves at once, by some tenths of
a millimetre for each kelvin. An integral that heats a spring through its hysteresis comes out on
the other side far too fast; then it does the same with the other spring. That is the limit cycle of
a hold.

So once the reference rests and the error is small, the loop gets a second feedback: the current
falls while the spring that it heats becomes warmer, and rises while that becomes colder. It has
authority within the hysteresis, where the displacement has none. The integral fades slowly, so that
a spring stays at the lower end, where less heat lets the displacement go at once. An error within
the band is none, and no water flows.
"""

from __future__ import annotations

import math

from smad.config import HoldConfig


class QuietHold:
    """Says whether the hold is quiet, and what the current is to follow then."""

    __slots__ = ("_config", "_inside_s", "_reference_m", "_smooth_m", "_warm_degC", "band_m",
                 "near", "quiet")  # fmt: skip

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
        self._warm_degC = [math.nan, math.nan]

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
            self._warm_degC = [math.nan, math.nan]
            return error_m
        half_m = 0.5 * self.band_m
        return smooth_m - min(half_m, max(-half_m, smooth_m))

    def resistance_A(self, spring: int, warm_degC: float, dt_s: float) -> float:
        """Current against the change of temperature of a spring (0 for x, 1 for y), A.

        To be asked for both springs with every sample of the quiet. It is 0 without a reading, and
        where the quiet begins.
        """
        config, before_degC = self._config, self._warm_degC[spring]
        if math.isnan(warm_degC) or math.isnan(before_degC):
            self._warm_degC[spring] = warm_degC
            return 0.0
        change_K = (warm_degC - before_degC) * dt_s / (config.smooth_s + dt_s)
        self._warm_degC[spring] += change_K
        return -config.damping_A_per_K * change_K


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
