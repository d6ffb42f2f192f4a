"""The noise floor of a channel: what of a recording is noise, and what is motion."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import pytest

from smad.diagnosis.data.noise import estimate_floors
from smad.diagnosis.paired.good import least_sd
from smad.diagnosis.plant import Array, Channel, ModelPoint, nominal_point
from smad.diagnosis.runs import GapRun
from smad.diagnosis.spring_pair import SmaPlant
from smad.diagnosis.spring_pair.recorded import recorded
from tests.smad.diagnosis.heater_plant import HeaterPlant
from tests.smad.diagnosis.heater_plant import recorded as heated

PLANT = SmaPlant()
PERIOD_S = 0.2
CURRENT = [c.name for c in PLANT.channels].index("i_meas_y_A")


@pytest.fixture(scope="module")
def run() -> GapRun:
    return recorded("levels", PLANT, nominal_point(PLANT), 1, duration_s=40.0)


def with_current(run: GapRun, course: Array) -> GapRun:
    """The run with a current through Y beside that of the controller; driver and meter know it."""
    inputs = {**run.inputs, "i_applied_y_A": run.inputs["i_applied_y_A"] + course}
    outputs = {**run.outputs, "i_meas_y_A": run.outputs["i_meas_y_A"] + course}
    return replace(run, inputs=inputs, outputs=outputs)


def floor(run: GapRun) -> float:
    return float(estimate_floors([run], PLANT, PERIOD_S)[CURRENT])


def test_a_current_that_is_asked_for_at_rest_is_no_noise(run: GapRun) -> None:
    unrest = np.abs(0.05 * np.random.default_rng(2).standard_normal(len(run.t_s) // 20 + 1))
    chatter = np.repeat(unrest, 20)[: len(run.t_s)]
    assert floor(with_current(run, chatter)) < 1.2 * floor(run)


def test_a_reading_that_no_simulator_explains_is(run: GapRun) -> None:
    hum = 0.06 * np.random.default_rng(3).standard_normal(len(run.t_s))
    read = {**run.outputs, "i_meas_y_A": run.outputs["i_meas_y_A"] + hum}
    assert floor(replace(run, outputs=read)) > 2.0 * floor(run)


@dataclass(frozen=True)
class Still(HeaterPlant):
    """A heater with a lid that stays where it is, read without noise or quantum."""

    channels: Sequence[Channel] = (
        *HeaterPlant().channels,
        Channel(name="lid", unit="V", quantum=0.0, low=0.0, high=10.0, noise=0.0),
    )

    def simulate(self, point: ModelPoint, run: GapRun, *, fast: bool = False) -> dict[str, Array]:
        return super().simulate(point, run, fast=fast) | {"lid": np.full(len(run.t_s), 5.0)}


@pytest.mark.parametrize("recorded_too", [True, False])
def test_a_still_channel_without_noise_has_a_floor(recorded_too: bool) -> None:
    run = heated("random", 1, duration_s=20.0)
    lid = {"lid": np.full(len(run.t_s), 5.0)} if recorded_too else {}
    floors = estimate_floors([run.with_columns(outputs=lid)], Still(), 0.5)
    assert floors[-1] == pytest.approx(0.01)
    assert least_sd(Still())[-1] > 0.0
