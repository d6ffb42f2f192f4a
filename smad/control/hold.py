"""A quiet hold: what the displacement loop does once it is where it should be.

The pair stands by itself while the temperature of the spring that pulls stays within its
hysteresis, some kelvin wide. An integral does not know that: it goes on while the spring is heated
through the hysteresis and nothing moves, drives it out on the other side far too fast, and then
does the same with the other spring. That is the limit cycle of a hold.

So once the reference rests and the error is within some bands, the current follows how far the
displacement has *drifted*, not where it stands: the error beyond half the band and beyond where it
has stood for a while. It eases off until the displacement begins to give way, rises until that
stops, and is kept. What of it brings the displacement back was too much, and is let go. An error
beyond `LASTING` bands that stands is worked off slowly. No water flows.
"""

from __future__ import annotations

import math

from smad.config import HoldConfig

NEAR = 5.0
"""Within so many bands a hold becomes quiet."""

FAR = 10.0
"""An error of so many bands ends the quiet at once."""

MARGIN = 0.25
"""In bands: so far from where the displacement has stood it has drifted, and not just trembled."""

LASTING = 1.5
"""In bands: a larger error is worked off although it stands."""

SLOWLY = 0.4
"""In bands: the error that is followed then."""


class QuietHold:
    """Says whether the hold is quiet, and which error the current is to follow then."""

    __slots__ = (
        "_config", "_inside_s", "_most_m", "_pull", "_reference_m", "_smooth_m", "_stood_m",
        "_watching", "band_m", "came_back", "drifted", "gave_way", "locked", "near", "quiet",
    )  # fmt: skip

    def __init__(self, config: HoldConfig) -> None:
        self._config = config
        self.band_m = config.band_mm * 1e-3
        self._pull = 0
        self.reset()

    def reset(self) -> None:
        """Begin as after a move."""
        self.quiet = False
        """Whether what is followed is the drift."""
        self.near = False
        """Whether the reference rests and the error is within some bands: no case for water."""
        self.drifted = False
        """Whether the displacement has given way in this quiet: the current is now one that holds.
        """
        self.came_back = False
        """Whether the pull has just brought the displacement back by another band."""
        self.gave_way = False
        """Whether the displacement has just begun to drift."""
        self._watching = True
        self.locked = False
        """Whether the direction must stay: the hold is quiet and there is nothing to follow."""
        self._reference_m = math.nan
        self._smooth_m = 0.0
        self._stood_m = 0.0
        self._most_m = 0.0
        self._inside_s = 0.0

    def pulls(self, direction: int) -> None:
        """Note which spring pulls now: +1 for X, -1 for Y."""
        if direction != self._pull:
            self._pull = direction
            self._most_m = direction * self._smooth_m
            self._watching = True

    def step(self, reference_m: float, error_m: float, dt_s: float) -> float:
        """The error to follow, m: all of it, or in the quiet the drift."""
        config, band_m = self._config, self.band_m
        if reference_m != self._reference_m:
            self.reset()
            self._reference_m = reference_m
            self._smooth_m = error_m
            return error_m
        self._smooth_m += (error_m - self._smooth_m) * dt_s / (config.smooth_s + dt_s)
        self.near = abs(self._smooth_m) < (FAR if self.quiet else NEAR) * band_m
        self._inside_s = self._inside_s + dt_s if self.near else 0.0
        self.quiet = self._inside_s >= config.settled_s
        self.locked = self.came_back = self.gave_way = False
        if not self.quiet:
            self.drifted = False
            self._watching = True
            self._stood_m = self._smooth_m
            self._most_m = self._pull * self._smooth_m
            return error_m
        drift_m = self._drift(dt_s)
        if drift_m != 0.0:
            # Otherwise it was brought too far: the current eases off again.
            self.drifted = drift_m * self._pull > 0.0
            self.gave_way = self._watching and self.drifted
            self._watching &= not self.gave_way
        elif min(abs(self._smooth_m), abs(self._stood_m)) > LASTING * band_m:
            drift_m = math.copysign(SLOWLY * band_m, self._smooth_m)
        self.locked = drift_m == 0.0
        left_m = self._pull * self._smooth_m
        self._most_m = max(self._most_m, left_m)
        self.came_back = self._most_m - left_m > band_m
        if self.came_back:
            self._most_m = left_m
            self._watching = True
        return drift_m

    def _drift(self, dt_s: float) -> float:
        error_m, band_m = self._smooth_m, self.band_m
        self._stood_m += (error_m - self._stood_m) * dt_s / (self._config.stand_s + dt_s)
        high_m = max(0.5 * band_m, self._stood_m + MARGIN * band_m)
        low_m = min(-0.5 * band_m, self._stood_m - MARGIN * band_m)
        return error_m - min(high_m, max(low_m, error_m))


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
