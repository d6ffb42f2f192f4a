"""When the pump of a spring runs: a switch with hysteresis, or duty by demand."""

from __future__ import annotations

from smad.config import CoolingConfig


class Switch:
    """On above one threshold, off below another, and neither for too short a time."""

    __slots__ = ("_for_s", "min_off_s", "min_on_s", "off_below", "on", "on_above")

    def __init__(
        self, on_above: float, off_below: float, min_on_s: float, min_off_s: float
    ) -> None:
        self.on_above = on_above
        self.off_below = off_below
        self.min_on_s = min_on_s
        self.min_off_s = min_off_s
        self.on = False
        self._for_s = min_off_s

    def step(self, demand: float, dt_s: float) -> bool:
        """Whether it is on, `dt_s` seconds later."""
        self._for_s += dt_s
        if self.on:
            if demand < self.off_below and self._for_s >= self.min_on_s:
                self._turn(False)
        elif demand > self.on_above and self._for_s >= self.min_off_s:
            self._turn(True)
        return self.on

    def stop(self) -> None:
        """Off at once, whatever the shortest time on."""
        if self.on:
            self._turn(False)

    def _turn(self, on: bool) -> None:
        self.on = on
        self._for_s = 0.0


class Pump:
    """The pump of one spring: runs while the other spring pulls, stops when this one is to heat."""

    __slots__ = ("_config", "_switch", "mode")

    def __init__(self, config: CoolingConfig) -> None:
        self._config = config
        self.mode: str = config.mode
        self._switch = Switch(
            config.on_threshold_A, config.off_threshold_A, config.min_on_s, config.min_off_s
        )

    def step(self, other_demand_A: float, heating: bool, dt_s: float) -> float:
        """Duty 0…1 for the demand on the other spring.

        Water is no help to a spring that is to heat, so `heating` stops it at once. In mode
        `proportional` the duty is min(1, demand / full_duty_current_A).
        """
        if heating:
            self._switch.stop()
            return 0.0
        if self.mode == "proportional":
            return min(1.0, max(0.0, other_demand_A) / self._config.full_duty_current_A)
        if self.mode == "off":
            return 0.0
        return self._config.switch_duty if self._switch.step(other_demand_A, dt_s) else 0.0
