"""A cause that other values of the parameters imitate altogether, and one that they do not."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from smad.gap import Settings
from smad.gap.records import Outcome

from smad.diagnosis.plant import Array, Effect, EffectParameter, ModelPoint
from smad.diagnosis.runs import GapRun
from tests.smad.gap.cases import OTHER, SHOWN, ask, bank
from tests.smad.gap.heater_plant import NOMINAL, HeaterPlant

LEAK = Effect(
    "leak", "a draught", "thermal", (EffectParameter("more_W_K", "W/K", 0.05, 0.0, 0.3),),
    ("temp_l_degC", "temp_r_degC", "rod_um"),
)  # fmt: skip


class Draughty(HeaterPlant):
    """The heater in a draught, which is to its plates what a larger loss is."""

    def simulate(
        self, point: ModelPoint, run: GapRun, views: Sequence[str], *, fast: bool = False
    ) -> dict[str, Array]:
        more = point.effects.get("leak", {}).get("more_W_K", 0.0)
        theta = {**NOMINAL, **point.theta}
        theta["ha_W_K"] += more
        return super().simulate(replace(point, theta=theta), run, views, fast=fast)


DRAUGHTY = Draughty((*HeaterPlant().library, LEAK))


def test_a_cause_that_other_parameters_imitate_is_said_not_to_be_told_from_them() -> None:
    moved = bank(OTHER | {"ha_W_K": OTHER["ha_W_K"] + 0.06})
    found = ask(moved, DRAUGHTY, good=bank(OTHER, seed=40)[:3])
    verdict = found.verdict
    assert verdict.outcome is Outcome.EFFECT, verdict.text
    assert verdict.effects == ["leak"]
    assert verdict.imitated
    assert found.experiments, "an experiment that would part cause and parameters"
    assert "as well as the cause" in verdict.text
    assert "not told apart: cause or other parameters" in verdict.text
    assert "none needed" not in verdict.text
    assert verdict.probability <= Settings().unsure_right


def test_a_cause_that_other_parameters_predict_better_than_is_told_but_not_named() -> None:
    moved = bank(OTHER | {"ha_W_K": 0.66, "rod_um_K": 3.3})
    found = ask(moved, DRAUGHTY, good=bank(OTHER, seed=40)[:3])
    verdict = found.verdict
    assert verdict.outcome is Outcome.PARAMETERS, verdict.text
    assert verdict.effects == []
    assert verdict.instead == ["leak"]
    assert verdict.gap_instead is not None
    assert found.experiments
    assert "a draught [leak] would leave" in verdict.text
    assert "other values of the parameters predict better" in verdict.text
    # What was fitted on the way there is told all the same.
    assert ["leak"] in [f.names for f in found.fitted]
    assert [f.names for f in found.fitted].count([]) == 2, "the tied refit and the free one"
    (leak,) = (c for c in found.candidates if c.name == "leak")
    assert leak.gain is not None


def test_a_cause_that_no_parameters_imitate_is_told_from_them() -> None:
    coupled = bank(OTHER, {"coupling": SHOWN["coupling"]})
    verdict = ask(coupled, DRAUGHTY, good=bank(OTHER, seed=40)[:3]).verdict
    assert verdict.effects == ["coupling"], verdict.text
    assert not verdict.imitated
    assert verdict.instead == []
    assert "as well as the cause" not in verdict.text
