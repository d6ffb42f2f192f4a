"""An input that steps while samples are lost: when it did is left open in that run."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from smad.diagnosis.data.admission import admit
from smad.diagnosis.data.played import predictions
from smad.diagnosis.places.bare import with_places
from smad.diagnosis.plant import nominal_point
from smad.diagnosis.rivals.evidence import recorded_evidence, without_drifts
from tests.smad.diagnosis.heater_plant import HeaterPlant, recorded


def residual(lost: slice) -> tuple[float, float, int]:
    """RMS in floors of a healthy run that lost samples at each step of its heater, as it is and
    with what is left open; and of how many steps that is."""
    plant = with_places(HeaterPlant())
    run = recorded("random", 1, duration_s=50.0)
    steps = np.flatnonzero(np.abs(np.diff(run.inputs["cmd_l_W"])) > 10.0) + 1
    kept = np.ones(len(run.t_s), dtype=bool)
    for step in steps:
        kept[step + lost.start : step + lost.stop] = False
    columns = [{n: c[kept] for n, c in cs.items()} for cs in (run.inputs, run.outputs)]
    (used,) = admit(
        [replace(run, t_s=run.t_s[kept], inputs=columns[0], outputs=columns[1])], plant, 1.0
    ).admitted
    floors = np.array([0.02, 0.02, 0.01, 0.01, 0.1])
    point = nominal_point(plant)
    evidence = recorded_evidence(plant, [used], floors, 1.0, point)
    rows = evidence.residual(
        predictions(plant, point, [t.played for t in evidence.trials], exact=True)
    )
    valid = evidence.valid > 0.0
    less_drifts = without_drifts(evidence, rows)
    rms = [float(np.sqrt(np.mean(r[valid] ** 2))) for r in (rows, less_drifts)]
    return rms[0], rms[1], len(evidence.drift_rows[0])


@pytest.mark.parametrize("lost", [slice(0, 1), slice(-1, 0)])
def test_a_step_that_was_lost_is_no_gap_whichever_of_its_samples_is(lost: slice) -> None:
    halfway, less_drifts, steps = residual(lost)
    of_whole_run, *_ = residual(slice(0, 0))
    assert steps > 2
    assert halfway > 1.5 * of_whole_run
    assert less_drifts < 1.15 * of_whole_run


def test_a_run_that_lost_no_step_has_nothing_left_open() -> None:
    _, _, steps = residual(slice(0, 0))
    assert steps == 0
