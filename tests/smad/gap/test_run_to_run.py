"""What differs from run to run: a plant reads it from the run itself."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from smad.diagnosis.plant import Array, ModelPoint
from smad.diagnosis.runs import GapRun
from tests.smad.gap.cases import OTHER, ask
from tests.smad.gap.heater_plant import NOMINAL, HeaterPlant, recorded

REST_ROWS = 30


class RoomOfTheRun(HeaterPlant):
    """The plates begin at the room's temperature: it is what the first three seconds show.

    The parameter of the room is what that is wrong by, beside its nominal value.
    """

    def simulate(
        self, point: ModelPoint, run: GapRun, views: Sequence[str], *, fast: bool = False
    ) -> dict[str, Array]:
        shown = [run.outputs[f"temp_{s}_degC"] for s in "lr" if f"temp_{s}_degC" in run.outputs]
        if not shown:
            return super().simulate(point, run, views, fast=fast)
        seen = float(np.mean([np.nanmean(y[:REST_ROWS]) for y in shown]))
        off = point.theta.get("t_a_degC", NOMINAL["t_a_degC"]) - NOMINAL["t_a_degC"]
        here = replace(point, theta={**point.theta, "t_a_degC": seen + off})
        return super().simulate(here, run, views, fast=fast)


def on_days(*, lag_s: float) -> list[GapRun]:
    """Runs of one bench on days of their own, in rooms of 19 to 25 °C."""
    effects = {"sensor_lag": {"tau_s": lag_s}} if lag_s else {}
    return [
        recorded("random", seed, {**OTHER, "t_a_degC": room}, effects, duration_s=40.0)
        for seed, room in ((1, 19.0), (2, 25.0), (3, 22.0))
    ]


def test_a_room_of_its_own_for_each_run_leaves_no_gap() -> None:
    runs = on_days(lag_s=0.0)
    assert ask(runs, HeaterPlant()).verdict.gap_refit > 3.0
    assert ask(runs, RoomOfTheRun()).verdict.gap_refit < 0.35


def test_a_room_of_its_own_for_each_run_does_not_hide_the_cause() -> None:
    assert ask(on_days(lag_s=1.5), RoomOfTheRun()).verdict.effects == ["sensor_lag"]
