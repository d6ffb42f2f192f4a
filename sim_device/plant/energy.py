"""The energy books of a run: where the heat went, and what the paper's numbers make or lose."""

from __future__ import annotations

from dataclasses import dataclass

from sim_device.plant import kernel as k
from sim_device.plant.setup import Setup


@dataclass(frozen=True)
class EnergyBook:
    """Both springs together, joule, from the start of the run.

    heat_in + forced + work_on + unequal
    = heat_to_water + heat_to_air + stored + omitted_work + closing.
    `stored` is a difference of states (sensible heat of wire, water and tube, latent and elastic
    energy), not a sum of flows, so `closing` is a real check: it is zero but for rounding.

    unequal: heat made by heat capacities and latent heats that differ between heating and cooling
    (the paper's do). omitted_work: transformation work that the paper's Eq. (15) leaves out of the
    heat balance. Both vanish with the conserving parameter set.
    work_on: mechanical work done on the springs by what holds them. forced: heat that a forcing or
    a law puts into wire and water.
    """

    heat_in: float
    work_on: float
    unequal: float
    heat_to_water: float
    heat_to_air: float
    stored: float
    omitted_work: float
    forced: float = 0.0

    @property
    def closing(self) -> float:
        income = self.heat_in + self.work_on + self.unequal + self.forced
        return income - (self.heat_to_water + self.heat_to_air + self.stored + self.omitted_work)


def stored_energy(state: k.State, setup: Setup) -> float:
    """Energy stored in both springs and their water at a state, J, as a function of state.

    Sensible heat counts from the reference temperature with the heating capacity; martensite lies
    below austenite by the latent heat of heating.
    """
    p, model = setup.p, setup.model[0]
    total = 0.0
    for of_y, s, e in ((0, state.x, model.x), (1, state.y, model.y)):
        xi = float(s.memory.xi_S + s.memory.xi_T)
        water = s.filled * p.warming_share * p.water_capacity * p.warms
        wall = e.wall_ratio * p.water_capacity * p.warms
        per_metre = (
            p.capacity_heating * (s.T_wire - p.T_ref)
            + water * (s.T_water - p.T_ref)
            - p.latent_heating * xi
            + wall * (s.T_wall - p.T_ref)
            + s.work_heat
        )
        total += float(p.length * per_metre)
        force = float(s.tension)
        total += 0.5 * force * force * float(k.compliance_of(setup.model, of_y, xi))
    return total


def energy_book(start: k.State, end: k.State, setup: Setup) -> EnergyBook:
    """The books between two states of one run."""

    def both(name: str) -> float:
        at_end = getattr(end.x, name) + getattr(end.y, name)
        return float(at_end - getattr(start.x, name) - getattr(start.y, name))

    return EnergyBook(
        heat_in=both("heat_in"),
        work_on=both("work_on"),
        unequal=both("unequal_heat"),
        heat_to_water=both("heat_to_water"),
        heat_to_air=both("heat_to_air"),
        stored=stored_energy(end, setup) - stored_energy(start, setup),
        omitted_work=both("omitted_work"),
        forced=both("heat_forced"),
    )
