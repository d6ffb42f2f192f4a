"""What the tests of the experiments share: the given parameters, and drivers that move nothing."""

from __future__ import annotations

from functools import cache

from sim_device.plant.models import Model
from sim_device.plant.parameters import ParameterSet, load_parameters
from smad.control.plan import Plan
from smad.experiments.driver import PARTS, Mounting
from smad.experiments.recording import Recording
from smad.experiments.virtual import VirtualDriver

NOMINAL = load_parameters("A")


@cache
def given() -> ParameterSet:
    """A bench that differs from the nominal set in everything that is to be recovered."""
    return NOMINAL.replace(
        modulus_martensite=NOMINAL["modulus_martensite"] * 1.08,
        modulus_austenite=NOMINAL["modulus_austenite"] * 0.95,
        stress_start=NOMINAL["stress_start"] * 1.08,
        stress_finish=NOMINAL["stress_finish"] * 0.94,
        max_deflection=NOMINAL["max_deflection"] * 0.95,
        initial_force=1.3,
        resistivity=NOMINAL["resistivity"] * 0.9,
        austenite_start=NOMINAL["austenite_start"] + 1.0,
        austenite_finish=NOMINAL["austenite_finish"] + 2.0,
        martensite_start=NOMINAL["martensite_start"] - 1.0,
        martensite_finish=NOMINAL["martensite_finish"] - 1.5,
        slope_austenite=NOMINAL["slope_austenite"] * 0.85,
        slope_martensite=NOMINAL["slope_martensite"] * 1.15,
    )


def driver(parameters: ParameterSet = NOMINAL, **options: object) -> VirtualDriver:
    return VirtualDriver(Model(parameters), seed=3, **options)


class NoDriver:
    """Has all parts but the lacking ones, and fails the test when anything is to move."""

    def __init__(self, *lacking: str, mounting: Mounting | None = None) -> None:
        self._lacking = frozenset(lacking)
        self._mounting = mounting

    def parts(self) -> frozenset[str]:
        return frozenset(PARTS) - self._lacking

    def mounting(self) -> Mounting | None:
        return self._mounting

    def run(self, plan: Plan) -> Recording:
        raise AssertionError(f"{plan.name} moved the bench")
