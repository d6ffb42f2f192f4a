"""What a model gains on regimes that it was not fitted to."""

from __future__ import annotations

from smad.gap import Settings
from smad.gap.diagnose import ready
from smad.gap.fit.joint import Start, joint_fits
from smad.gap.fit.judge import regime_gains
from smad.gap.fit.lsq import FitResult
from smad.gap.fit.stages import Prepared

from tests.smad.gap.cases import OTHER, SHOWN, bank
from tests.smad.gap.heater_plant import EFFECTS, HeaterPlant


def fitted(prepared: Prepared, name: str) -> FitResult:
    effect = next(e for e in EFFECTS if e.name == name)
    start = Start((effect,), {name: SHOWN[name]})
    return next(iter(joint_fits(prepared.fit, [start]).values())).fit


def test_a_regime_that_leaves_either_model_undetermined_is_not_compared() -> None:
    stronger = {"driver_gain": SHOWN["driver_gain"]}
    prepared = ready(bank(OTHER, stronger), plant=HeaterPlant(), settings=Settings())
    masks = prepared.problem.dataset.regime_masks
    gain, flow = fitted(prepared, "driver_gain"), fitted(prepared, "coupling")
    # Without power nothing tells a driver's gain; plates that cool still tell of heat between them.
    assert "heating" in regime_gains(prepared.fit, flow, masks)
    assert "heating" not in regime_gains(prepared.fit, gain, masks)
    assert "heating" not in regime_gains(gain, flow, masks)
