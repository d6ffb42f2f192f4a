"""What the board does with a setpoint and when it ends a run, for many plants at once.

The limits are the board's own table. Of its checks those stand here that a good bench can run into;
the others are about broken parts, which an environment does not have.
"""

import numpy as np
import numpy.typing as npt

from firmware_protocol.enums import Fault
from firmware_protocol.supervisor.limits import compiled_limits
from smad.arrays import Array, Mask

Counts = npt.NDArray[np.int64]


class Boards:
    """Of each plant: what current is let through, and whether a fault has come. Integers of the
    wire, as on the board."""

    def __init__(self, size: int) -> None:
        self.limits = compiled_limits()
        self._hot: Counts = np.zeros((size, 2), dtype=np.int64)
        self._i2t_mA2us: Counts = np.zeros((size, 2), dtype=np.int64)
        self._t_cC: Counts = np.zeros((size, 2), dtype=np.int64)
        self._applied_mA: Counts = np.zeros((size, 2), dtype=np.int64)

    def begin(self, i: int) -> None:
        """Board `i` is armed anew."""
        for memory in (self._hot, self._i2t_mA2us, self._applied_mA, self._t_cC):
            memory[i] = 0

    def observe(self, t_cC: Counts, i_mA: Counts, dt_us: int, which: Mask) -> Counts:
        """Take a sample of the boards in `which`: RTDs and currents of both springs, (size, 2).

        Returns the fault of each board as its number, 0 for none.
        """
        lim = self.limits
        going = which[:, None]
        self._t_cC = np.where(going, t_cC, self._t_cC)
        over = t_cC > lim.temperature_limit_cC
        cool = t_cC <= lim.temperature_limit_cC - lim.temperature_hysteresis_cC
        hot_for = np.where(over, self._hot + 1, np.where(cool, 0, self._hot))
        self._hot = np.where(going, hot_for, self._hot)
        rated_mA2 = lim.i2t_rated_mA**2
        total = np.maximum(self._i2t_mA2us + (i_mA**2 - rated_mA2) * dt_us, 0)
        self._i2t_mA2us = np.where(going, total, self._i2t_mA2us)
        trip_mA2us = (11 * lim.i2t_budget_A2s // 10 + 1) * 10**12
        faults = np.zeros(len(t_cC), dtype=np.int64)
        faults[(self._i2t_mA2us >= trip_mA2us).any(axis=1)] = int(Fault.I2T)
        hot = (self._hot >= lim.debounce_samples).any(axis=1)
        faults[hot] = int(Fault.OVER_TEMPERATURE)
        return faults

    def regulate(self, wanted_A: Array, dt_us: int, which: Mask) -> Array:
        """Currents that the drivers get of those asked for, A, (size, 2), of boards in `which`."""
        lim = self.limits
        ceiling = np.full(self._t_cC.shape, lim.current_limit_mA, dtype=np.int64)
        spent = self._i2t_mA2us >= lim.i2t_budget_A2s * 10**12
        ceiling[spent] = np.minimum(ceiling[spent], lim.i2t_rated_mA)
        span_cC = max(lim.fold_end_cC - lim.fold_start_cC, 1)
        left_cC = np.maximum(lim.fold_end_cC - self._t_cC, 0)
        folded = lim.current_limit_mA * left_cC // span_cC
        warm = self._t_cC > lim.fold_start_cC
        ceiling[warm] = np.minimum(ceiling[warm], folded[warm])
        slewed = self._applied_mA + lim.current_slew_mA_per_ms * dt_us // 1000
        wanted_mA = np.rint(wanted_A * 1e3).astype(np.int64)
        applied = np.minimum(np.minimum(wanted_mA, ceiling), slewed)
        self._applied_mA = np.where(which[:, None], applied, self._applied_mA)
        return np.asarray(self._applied_mA * 1e-3, dtype=np.float64)
