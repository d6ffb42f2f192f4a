"""Cases on the tiny plant: effects at strengths that show, and the runs made of them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import replace
from typing import Any

from smad.gap import Diagnosis, Settings, diagnose

from smad.diagnosis.plant import Effect
from smad.diagnosis.runs import GapRun
from tests.smad.gap.heater_plant import EFFECTS, HeaterPlant, recorded

OTHER = {"c_J_K": 31.0, "ha_W_K": 0.57}
FAR_OFF = {"c_J_K": 34.5, "ha_W_K": 0.51, "fan_gain": 1.7, "rod_um_K": 3.45, "t_a_degC": 24.0}
SHOWN: dict[str, dict[str, float]] = {
    "sensor_lag": {"tau_s": 1.2},
    "coupling": {"g_W_K": 0.12},
    "driver_gain": {"g": 0.04},
    "backlash": {"gap_um": 3.0},
    "dial_delay": {"delay_s": 0.3},
    "sticky_fan": {"tau_s": 1.5},
}
ALIKE = {"backlash": {"gap_um": 1.2}}
SETTINGS = Settings()


def bank(
    theta: Mapping[str, float] | None = None,
    effects: Mapping[str, Mapping[str, float]] | None = None,
    seed: int = 0,
) -> list[GapRun]:
    """Four runs of two families."""
    families = ("random", "random", "sines", "sines")
    return [
        recorded(family, seed + i, theta, effects, duration_s=50.0)
        for i, family in enumerate(families, start=1)
    ]


def without(*names: str) -> HeaterPlant:
    """The plant with effects taken out of its library."""
    return HeaterPlant(tuple(e for e in EFFECTS if e.name not in names))


class WithoutExperiments:
    """The tiny plant, as somebody may bring one who has no catalogue."""

    def __init__(self) -> None:
        whole = HeaterPlant()
        for member in (
            "name", "version", "inputs", "channels", "parameters", "effects", "views", "simulate",
            "regimes", "features",
        ):  # fmt: skip
            setattr(self, member, getattr(whole, member))


def ask_alike(more: Sequence[GapRun] = (), plant: Any = None) -> Diagnosis:
    """A dial with play, in slow ramps that turn once: there a late one looks the same."""
    slow = [recorded("still", s, OTHER, ALIKE, duration_s=24.0) for s in (1, 2, 3)]
    names = ["backlash", "dial_delay"]
    return diagnose(
        [*slow, *more], plant=plant or HeaterPlant(), settings=SETTINGS, candidates=names
    )


def ask(
    runs: list[GapRun],
    plant: HeaterPlant | None = None,
    *,
    good: list[GapRun] | None = None,
    hold_out: list[GapRun] | None = None,
    executor: Executor | None = None,
) -> Diagnosis:
    """A diagnosis with the settings of the tests."""
    return diagnose(
        runs,
        plant=plant or HeaterPlant(),
        good=good or (),
        hold_out=hold_out or (),
        settings=SETTINGS,
        executor=executor,
    )


def renamed(plant: HeaterPlant, names: Mapping[str, str]) -> RenamedPlant:
    """The same plant, whose library calls its effects by other names."""
    return RenamedPlant(
        tuple(replace(e, name=names.get(e.name, e.name)) for e in reversed(plant.library)),
        names=dict(names),
    )


class RenamedPlant(HeaterPlant):
    """Translates the names of effects before it simulates."""

    def __init__(self, library: tuple[Effect, ...], names: dict[str, str]) -> None:
        super().__init__(library)
        object.__setattr__(self, "_back", {new: old for old, new in names.items()})

    def simulate(self, point, run, views, *, fast=False):  # type: ignore[no-untyped-def]
        back = self.__dict__["_back"]
        effects = {back.get(k, k): v for k, v in point.effects.items()}
        return super().simulate(replace(point, effects=effects), run, views, fast=fast)
