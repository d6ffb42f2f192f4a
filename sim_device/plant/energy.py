"""The energy books of a run: where the heat went, and what the paper's numbers make or lose."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from sim_device.plant import kernel as k

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class EnergyBook:
    """Both springs together, joule, from the start of the run.

    heat_in + work_on + unequal = heat_to_water + heat_to_air + stored + omitted_work + closing.
    `stored` is a difference of states (sensible heat of wire, water and tube, latent and elastic
    energy), not a sum of flows, so `closing` is a real check: it is zero but for rounding.

    unequal: heat made by heat capacities and latent heats that differ between heating and cooling
    (the paper's do). omitted_work: transformation work that the paper's Eq. (15) leaves out of the
    heat balance. Both vanish with the conserving parameter set.
    work_on: mechanical work done on the springs by what holds them.
    """

    heat_in: float
    work_on: float
    unequal: float
    heat_to_water: float
    heat_to_air: float
    stored: float
    omitted_work: float

    @property
    def closing(self) -> float:
        income = self.heat_in + self.work_on + self.unequal
        return income - (self.heat_to_water + self.heat_to_air + self.stored + self.omitted_work)


def stored_energy(s: Array, p: Array, e: Array) -> float:
    """Energy stored in both springs and their water at a state, J, as a function of state.

    Sensible heat counts from the reference temperature with the heating capacity; martensite lies
    below austenite by the latent heat of heating.
    """
    total = 0.0
    for o in (0, k.S_SIZE):
        xi = float(s[o + k.S_XS] + s[o + k.S_XT])
        water = s[o + k.S_FILL] * p[k.P_SHARE] * p[k.P_CW] * p[k.P_WARMS]
        per_metre = (
            p[k.P_MC_H] * (s[o + k.S_T] - p[k.P_T_REF])
            + water * (s[o + k.S_TW] - p[k.P_T_REF])
            - p[k.P_ML_H] * xi
            + e[k.E_WALL] * p[k.P_CW] * p[k.P_WARMS] * (s[o + k.S_T_WALL] - p[k.P_T_REF])
            + s[o + k.S_WORK_Q]
        )
        total += float(p[k.P_LENGTH] * per_metre)
        force = float(s[o + k.S_F])
        total += 0.5 * force * force * float(k.compliance(xi, p, e))
    return total


def energy_book(start: Array, end: Array, p: Array, e: Array) -> EnergyBook:
    """The books between two states of one run."""

    def both(slot: int) -> float:
        at_end = end[slot] + end[k.S_SIZE + slot]
        return float(at_end - start[slot] - start[k.S_SIZE + slot])

    return EnergyBook(
        heat_in=both(k.S_IN_J),
        work_on=both(k.S_WORK_J),
        unequal=both(k.S_UNEQUAL_J),
        heat_to_water=both(k.S_WATER_J),
        heat_to_air=both(k.S_AIR_J),
        stored=stored_energy(end, p, e) - stored_energy(start, p, e),
        omitted_work=both(k.S_OMITTED_J),
    )
