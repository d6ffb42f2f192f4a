"""What a diagnosis is shown and stored as, and what follows from it."""

from __future__ import annotations

import json
import re
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import pytest

from smad.gap import diagnose
from smad.gap.apply import apply, model_point
from smad.gap.assess import borne_out
from smad.gap.errors import PlantMismatch, RunRefused
from smad.gap.fit import JointFit
from smad.gap.nextexp import Trial, propose, runs_for
from smad.gap.plant import ModelPoint
from smad.gap.records import Diagnosis, Outcome
from smad.gap.report import page_of, summary_lines
from smad.gap.runs import GapRun
from smad.gap.select import Candidate
from smad.gap.settings import Settings
from smad.gap.sma import SmaPlant
from smad.gap.verify import verified
from smad.report.page import render
from tests.smad.gap.cases import OTHER, QUICK, ask, bank
from tests.smad.gap.heater_plant import NOMINAL, HeaterPlant, recorded

EFFECT = {"coupling": {"g_W_K": 0.12}}


@pytest.fixture(scope="module")
def found() -> Diagnosis:
    return ask(bank(OTHER, EFFECT))


def test_the_json_file_holds_the_whole_diagnosis(found: Diagnosis) -> None:
    assert Diagnosis.from_json(found.to_json()) == found
    assert "NaN" not in found.to_json().decode()


def test_the_page_shows_what_the_json_holds(found: Diagnosis) -> None:
    html = render(page_of(found))
    text = re.sub(r"<[^>]+>", " ", html)
    for needed in (
        found.verdict.effects[0],
        *(r.name for r in found.runs),
        *(r.sha256[:16] for r in found.runs),
        *(p.name for p in found.parameters),
        *(c.name for c in found.candidates),
        found.versions["numpy"],
        *found.limits,
    ):
        assert needed in text or needed in html
    assert "http" not in re.sub(r'xmlns(:\w+)?="[^"]*"', "", html)
    assert html.count("<svg") >= 5


def test_every_outcome_makes_a_page() -> None:
    for diagnosis in (ask(bank()), ask([recorded("random", 1).part(0, 30)])):
        assert "Gap diagnosis" in render(page_of(diagnosis))
        assert summary_lines(diagnosis)[1] == diagnosis.verdict.text


def test_the_waterfall_falls_from_raw_over_the_refit_to_the_floor(found: Diagnosis) -> None:
    for view in ("open loop", "local"):
        total = next(r for r in found.waterfall if r.view == view and not r.output)
        assert total.raw >= total.refit > 3 * total.effects[-1]
    assert found.steps == [["coupling"]]


def test_the_text_gives_the_numbers_of_the_record(found: Diagnosis) -> None:
    v = found.verdict
    assert f"{v.gap_raw:.1f}×" in v.text
    assert f"S = {v.shrink:.2f}" in v.text
    assert f"probability {v.probability:.2f}" in v.text


class Saving(HeaterPlant):
    """The tiny plant with model files."""

    def save_model(self, point: ModelPoint, path: Path, note: str) -> None:
        body = {"theta": dict(point.theta), "effects": point.effects, "note": note}
        path.write_text(json.dumps(body))

    def load_model(self, path: Path) -> ModelPoint:
        raw = json.loads(path.read_text())
        return ModelPoint(raw["theta"], raw["effects"])


def test_the_applied_model_closes_the_gap_of_new_runs(found: Diagnosis, tmp_path: Path) -> None:
    plant = Saving()
    apply(found, plant, tmp_path / "model.json")
    new = [recorded("random", 31, OTHER, EFFECT), recorded("sines", 32, OTHER, EFFECT)]
    rows = verified(plant, new, plant.load_model(tmp_path / "model.json"))
    assert rows[-1].channel == "all"
    assert rows[-1].before > 3.0
    assert rows[-1].shrink > 0.85


def test_a_diagnosis_without_runs_has_no_model() -> None:
    refused = ask([recorded("random", 1).part(0, 30)])
    with pytest.raises(PlantMismatch, match="no run could be used"):
        model_point(refused)
    with pytest.raises(RunRefused, match="no run can be used"):
        verified(HeaterPlant(), [recorded("random", 1).part(0, 30)], ModelPoint(NOMINAL))


def test_a_model_file_of_the_spring_pair_comes_back_as_it_was(tmp_path: Path) -> None:
    plant = SmaPlant()
    point = ModelPoint({"flow_max": 1.2e-7, "side_flow": 0.04}, {"rtd_lag": {"tau_s": 0.3}})
    plant.save_model(point, tmp_path / "model.toml", "a note")
    back = plant.load_model(tmp_path / "model.toml")
    assert back.theta["flow_max"] == pytest.approx(1.2e-7)
    assert back.effects["rtd_lag"]["tau_s"] == pytest.approx(0.3)
    assert back.effects["uneven_flow"]["share"] == pytest.approx(0.04)
    with pytest.raises(PlantMismatch, match="another variant"):
        SmaPlant(variant="printed").load_model(tmp_path / "model.toml")


def test_weak_excitation_leaves_two_causes_and_the_proposal_tells_them_apart() -> None:
    """A late dial and a dial with play look alike in a slow ramp that turns once."""
    from smad.gap.fit import Start, joint_fits
    from smad.gap.stages import prepare

    plant = HeaterPlant()
    bench = {"backlash": {"gap_um": 1.2}}
    runs = [recorded("still", s, OTHER, bench, duration_s=24.0) for s in (1, 2)]
    prepared = prepare(runs, plant, Settings())
    library = {e.name: e for e in plant.effects}
    starts = [Start((library[n],), {n: library[n].at(0.4)}) for n in ("backlash", "dial_delay")]
    fits = [j.fit for j in joint_fits(prepared.fit, starts).values()]
    proposals = propose(fits, [0.5, 0.5], prepared.noise, plant.catalogue())
    assert [p.separation for p in proposals] == sorted(
        (p.separation for p in proposals), reverse=True
    )
    assert proposals[0].separation > 16.0
    assert proposals[0].separation > 2 * proposals[-1].separation
    assert propose(fits, [0.5, 0.5], prepared.noise, plant.catalogue(), most=1) == proposals[:1]
    for p in proposals:
        trial = Trial(fits, [0.5, 0.5], p.experiment, prepared.noise)
        assert 0.0 < trial.separation() == p.foretold == p.separation <= trial.bound
    fewer = propose(fits, [0.5, 0.5], prepared.noise, plant.catalogue(), share=0.1)
    assert [q.experiment for q in fewer] == [p.experiment for p in proposals]
    assert [q.separation for q in fewer] == [pytest.approx(0.1 * p.foretold) for p in proposals]


@pytest.mark.parametrize(
    ("separation", "runs"), [(40.0, 1), (16.0, 1), (15.9, 2), (2.7, 6), (2.6, None), (0.0, None)]
)
def test_runs_add_up_to_a_separation_or_are_too_many(separation: float, runs: int | None) -> None:
    assert runs_for(16.0, separation, most=6) == runs


def test_a_separation_counts_less_the_more_its_gain_varied() -> None:
    from smad.gap.stages import prepare

    plant = HeaterPlant()
    runs = [recorded("steps", s, OTHER, {"backlash": {"gap_um": 6.0}}) for s in (1, 2)]
    prepared = prepare(runs[:1], plant, Settings(), hold_out=runs[1:])
    c = replace(Candidate(JointFit(prepared.fit, ()), prepared.free), gain=200.0, gain_se=40.0)
    shares = [borne_out(c, d2, prepared.hold) for d2 in (80.0, 160.0, 900.0)]
    # As many rows were held out as were fitted: the gain may vary by √2 d.
    assert shares == [pytest.approx(0.1), pytest.approx(0.2), 1.0]
    assert borne_out(c, 80.0, None) == pytest.approx(0.05)
    assert borne_out(replace(c, gain_se=0.0), 80.0, None) == 0.0


def test_two_causes_that_look_alike_are_told_apart_by_the_experiment_that_is_recommended() -> None:
    bench = {"backlash": {"gap_um": 1.2}}
    slow = [recorded("still", s, OTHER, bench, duration_s=24.0) for s in (1, 2, 3)]

    def asked(more: Sequence[GapRun] = ()) -> Diagnosis:
        names = ["backlash", "dial_delay"]
        return diagnose([*slow, *more], plant=HeaterPlant(), settings=QUICK, candidates=names)

    before = asked()
    assert before.verdict.outcome is Outcome.AMBIGUOUS
    assert {*before.verdict.effects, *before.verdict.group} == {"backlash", "dial_delay"}
    first = before.experiments[0]
    assert 16.0 < first.separation < first.foretold
    assert first.runs == 1
    said = f"{first.title} (60 s, separation d² ≈ {first.expected} a run), one run."
    assert before.verdict.text.endswith(said)
    assert "runs needed" in render(page_of(before))
    after = asked([recorded(first.name, 9, OTHER, bench)])
    assert after.verdict.outcome is Outcome.EFFECT
    assert after.verdict.effects == ["backlash"]
    assert after.experiments == []
