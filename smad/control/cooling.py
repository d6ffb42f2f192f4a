"""When the pump of a spring runs: a switch with hysteresis, or duty by demand."""

from smad.config import CoolingConfig


class PumpStarts:
    """Counts how often each pump went from rest to running, from the duties the board reports."""

    __slots__ = ("_ran", "x", "y")

    def __init__(self) -> None:
        self.x = self.y = 0
        self._ran = (False, False)

    def step(self, duty: tuple[float, float]) -> tuple[int, int]:
        """The counts (x, y) after a sample with these duties."""
        runs = (duty[0] > 0.0, duty[1] > 0.0)
        if runs != self._ran:
            self.x += runs[0] and not self._ran[0]
            self.y += runs[1] and not self._ran[1]
            self._ran = runs
        return self.x, self.y


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

    def step(self, demand: float, dt_s: float, *, urgent: bool = False) -> bool:
        """Whether it is on, `dt_s` seconds later; `urgent` does not wait for the shortest times."""
        self._for_s += dt_s
        if self.on:
            if demand < self.off_below and (urgent or self._for_s >= self.min_on_s):
                self._turn(False)
        elif demand > self.on_above and (urgent or self._for_s >= self.min_off_s):
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
    """The pump of one spring: runs while the other spring pulls, never while this one is heated.

    A running pump keeps its shortest time on, so the spring that it cools has to wait for current
    until `running` is False; a large demand does not wait (`urgent_A`).
    """

    __slots__ = ("_config", "_switch", "_unheated_s", "mode")

    def __init__(self, config: CoolingConfig) -> None:
        self._config = config
        self._unheated_s = config.after_heat_s
        self.mode: str = config.mode
        self._switch = Switch(
            config.on_threshold_A, config.off_threshold_A, config.min_on_s, config.min_off_s
        )

    @property
    def running(self) -> bool:
        """Whether the last step let water through."""
        return self._switch.on

    def step(
        self, other_demand_A: float, own_demand_A: float, dt_s: float, *, sudden: bool = False
    ) -> float:
        """Duty 0…1 for the demand on the other spring, and that on its own.

        In mode `proportional` the duty while on is min(1, demand / full_duty_current_A), and at
        least that of `off_threshold_A`.
        """
        config = self._config
        if self.mode == "off":
            self._switch.stop()
            return 0.0
        urgent = max(other_demand_A, own_demand_A) >= config.urgent_A
        self._unheated_s = 0.0 if own_demand_A > 0.0 else self._unheated_s + dt_s
        # A demand that grows gently starts the water gently; a sudden one would quench the spring.
        wait_s = config.after_heat_s if sudden or self.mode == "switch" else 0.0
        wanted_A = other_demand_A if self._unheated_s >= wait_s and own_demand_A <= 0.0 else -1.0
        if not self._switch.step(wanted_A, dt_s, urgent=urgent):
            return 0.0
        if self.mode == "switch":
            return config.switch_duty
        return min(1.0, max(config.off_threshold_A, wanted_A) / config.full_duty_current_A)

    def stop(self) -> None:
        """Off at once."""
        self._switch.stop()
