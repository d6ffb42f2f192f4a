"""A quiet hold: what the displacement loop does once it is where it should be.

The pair stands by itself while the temperature of the spring that pulls stays within its
hysteresis, some kelvin wide. Control that answers every count of the encoder there moves nothing
and wears relay and pump. So once the reference rests and the error is within a band, neither
spring's direction changes, no water flows, and the current follows only what is left of a smoothed
error beyond half the band.

Where friction lets the pair jump by more than the band, an integral goes from one side to the other
for ever. So a hold whose pull turns more than once takes a wider band from then on.
"""

from __future__ import annotations

from smad.config import HoldConfig

FAR = 5.0
"""An error of so many bands ends the quiet at once."""

WIDER = 2.0
"""By how much each further turn of the pull widens the band of this hold; the current then follows
what is beyond the band less half of `band_m`."""

WIDEST = 4.0
"""In bands: below `FAR`."""


class QuietHold:
    """Says whether the hold is quiet, and which error the current is to follow then."""

    __slots__ = (
        "_config", "_inside_s", "_pull", "_reference_m", "_smooth_m", "_turns", "band_m", "near",
        "quiet",
    )  # fmt: skip

    def __init__(self, config: HoldConfig) -> None:
        self._config = config
        self.band_m = config.band_mm * 1e-3
        self.reset()

    def reset(self) -> None:
        """Begin as after a move."""
        self.quiet = False
        """Whether the error that is followed is the smoothed one beyond half the band."""
        self.near = False
        """Whether the reference rests and the error is within `FAR` bands: no case for water."""
        self._reference_m = float("nan")
        self._smooth_m = 0.0
        self._inside_s = 0.0
        self._pull = 0
        self._turns = 0

    @property
    def wide_m(self) -> float:
        """The band of this hold, m: `band_m` until its pull has turned more than once."""
        return self.band_m * min(WIDEST, WIDER ** max(0, self._turns - 1))

    def pulls(self, direction: int) -> None:
        """Note which spring pulls now: +1 for X, -1 for Y."""
        self._turns += self.quiet and self._pull == -direction
        self._pull = direction

    @property
    def locked(self) -> bool:
        """Whether the direction must stay: the hold is quiet and the error within the band."""
        return self.quiet and abs(self._smooth_m) <= self.wide_m

    def step(self, reference_m: float, error_m: float, dt_s: float) -> float:
        """The error to follow, m: all of it, or in the quiet what is beyond half the band."""
        config, band_m = self._config, self.band_m
        if reference_m != self._reference_m:
            self.reset()
            self._reference_m = reference_m
            self._smooth_m = error_m
            return error_m
        self._smooth_m += (error_m - self._smooth_m) * dt_s / (config.smooth_s + dt_s)
        size_m = abs(self._smooth_m)
        self.near = size_m < FAR * band_m
        self._inside_s = self._inside_s + dt_s if self.near else 0.0
        self.quiet = self._inside_s >= config.settled_s
        if not self.quiet:
            return error_m
        rest_m = max(0.0, size_m - (self.wide_m - 0.5 * band_m))
        return rest_m if self._smooth_m > 0.0 else -rest_m


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
