"""Cases on the tiny plant: effects at strengths that show, and the runs made of them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from smad.diagnosis import Verdict, diagnose
from smad.diagnosis.plant import Effect
from smad.diagnosis.runs import GapRun
from tests.smad.diagnosis.heater_plant import HeaterPlant, recorded

OTHER = {"c_J_K": 31.0, "ha_W_K": 0.57}
FAR_OFF = {"c_J_K": 34.5, "ha_W_K": 0.51, "fan_gain": 1.7, "rod_um_K": 3.45, "t_a_degC": 24.0}
GAIN = {"driver_gain": {"g": 0.05}}


def bank(
    theta: Mapping[str, float] | None = None,
    effects: Mapping[str, Mapping[str, float]] | None = None,
    seed: int = 0,
    day: int = 99,
) -> list[GapRun]:
    """Four runs of two families, with the noise of a day."""
    families = ("random", "random", "sines", "sines")
    return [
        recorded(family, seed + i, theta, effects, duration_s=50.0, day=day)
        for i, family in enumerate(families, start=1)
    ]


def ask(
    runs: Sequence[GapRun],
    plant: HeaterPlant | None = None,
    *,
    good: Sequence[GapRun] = (),
    hold_out: Sequence[GapRun] = (),
) -> Verdict:
    """The verdict of a whole diagnosis of the tiny plant."""
    return diagnose(runs, plant=plant or HeaterPlant(), good=good, hold_out=hold_out).verdict


def strong(effect: Effect, level: float = 1.0) -> dict[str, float]:
    """Values of an effect with every strength at `level` times its typical value."""
    return {q.name: q.typical * level if q.strength else q.typical for q in effect.parameters}
