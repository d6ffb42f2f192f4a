"""What a bench uses: heating energy and cycles of displacement, from its samples. Pure."""

from smad.queue.states import Usage
from smad.runlog.cycles import Cycles
from smad.runlog.schema import Row

DEAD_BAND_MM = 0.5
"""A turn counts once the displacement has come back by so much: noise makes no cycles."""
LONGEST_GAP_S = 1.0
"""Over a longer gap between samples nothing is integrated."""


class Meter:
    """Integrates the power of both heaters and counts cycles.

    A cycle is a turn at the top after a turn at the bottom. Without voltages the energy is that of
    1 ohm, the order of a spring's resistance.
    """

    def __init__(self) -> None:
        self._energy_J = 0.0
        self._cycles = Cycles(DEAD_BAND_MM)
        self._counted = 0
        self._before: tuple[float, float] | None = None

    def sample(self, row: Row) -> None:
        """Take in one sample."""
        power_W = sum(
            abs(current_A * (current_A if volts is None else volts))
            for current_A, volts in ((row.i_meas_x_A, row.v_x_V), (row.i_meas_y_A, row.v_y_V))
            if current_A is not None
        )
        if self._before is not None:
            gap_s = row.t_s - self._before[0]
            if 0.0 < gap_s <= LONGEST_GAP_S:
                self._energy_J += 0.5 * (power_W + self._before[1]) * gap_s
        self._before = row.t_s, power_W
        self._cycles.add(row.displacement_mm)

    def take_usage(self) -> Usage:
        """Return what was used since the last call."""
        usage = Usage(energy_J=self._energy_J, cycles=float(self._cycles.tops - self._counted))
        self._energy_J, self._counted = 0.0, self._cycles.tops
        return usage
