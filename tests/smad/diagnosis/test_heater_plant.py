"""The tiny plant answers as `PlantModel` asks, also where it cannot run."""

import warnings

import numpy as np
import pytest

from smad.diagnosis.plant import EffectValues, ModelPoint
from tests.smad.diagnosis.heater_plant import HeaterPlant, recorded

RUNAWAY = {"coupling": {"g_W_K": 5e9}}


@pytest.mark.parametrize(
    "more", [{}, {"backlash": {"gap_um": 4.0}}, {"dial_delay": {"delay_s": 0.4}}]
)
def test_a_plate_that_diverges_is_answered_with_nan_and_without_a_warning(
    more: EffectValues,
) -> None:
    run = recorded("one side", 1, duration_s=10.0)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        out = HeaterPlant().simulate(ModelPoint({}, {**RUNAWAY, **more}), run)
    for name in ("temp_l_degC", "temp_r_degC", "rod_um"):
        assert np.isnan(out[name][-1])
        assert not np.isinf(out[name]).any()
    assert np.isfinite(out["power_l_W"]).all()
