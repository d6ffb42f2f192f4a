"""What a diagnosis is shown and stored as, and what follows from it."""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pytest
from msgspec.structs import replace
from smad.gap.compare.assess import counted_share
from smad.gap.compare.nextexp import Trial, enough, propose
from smad.gap.fit.hypothesis import Hypothesis
from smad.gap.fit.joint import JointFit
from smad.gap.fit.judge import Judged
from smad.gap.fit.lsq import FitResult
from smad.gap.records import Diagnosis, ExperimentRecord, Outcome, RepeatedRecord
from smad.gap.report import page_of, summary_lines
from smad.gap.report.numbers import next_line
from smad.gap.settings import Settings

from sim_device.plant import load_parameters
from smad.diagnosis.errors import GapError, PlantMismatch, RunRefused
from smad.diagnosis.model_file import apply, model_point, uncertainty_of
from smad.diagnosis.plant import Array, ModelPoint, performed
from smad.diagnosis.search.space import Space
from smad.diagnosis.spring_pair import SmaPlant
from smad.diagnosis.verify import verified
from smad.report.page import render
from tests.smad.gap.cases import ALIKE, OTHER, WithoutExperiments, ask, ask_alike, bank
from tests.smad.gap.heater_plant import NOMINAL, HeaterPlant, recorded

EFFECT = {"coupling": {"g_W_K": 0.12}}


@pytest.fixture(scope="module")
def found() -> Diagnosis:
    return ask(bank(OTHER, EFFECT))


def test_the_json_file_holds_the_whole_diagnosis(found: Diagnosis) -> None:
    assert Diagnosis.from_json(found.to_json()) == found
    assert "NaN" not in found.to_json().decode()


def test_the_model_says_how_uncertain_its_values_are_as_the_intervals_do(found: Diagnosis) -> None:
    known = uncertainty_of(found)
    assert known is not None
    deviation = dict(zip(known.names, np.sqrt(np.diag(known.covariance)), strict=True))
    assert set(deviation) == {*found.model["theta"], "coupling.g_W_K"}
    for p in found.parameters:
        # A 95 % interval of normal draws is ± 1.96 of their deviation; these are nearly normal.
        assert 3.92 * deviation[p.name] == pytest.approx(p.high - p.low, rel=0.3)
    assert np.linalg.eigvalsh(known.covariance).min() > -1e-12


def test_what_the_runs_do_not_tell_is_as_uncertain_as_the_prior() -> None:
    # The fan never runs.
    still = [recorded("still", seed, OTHER, EFFECT, duration_s=30.0) for seed in (1, 2, 3)]
    known = uncertainty_of(ask(still))
    assert known is not None
    deviation = dict(zip(known.names, np.sqrt(np.diag(known.covariance)), strict=True))
    prior = {p.name: p.prior_sd for p in HeaterPlant().parameters}
    assert deviation["fan_gain"] == pytest.approx(prior["fan_gain"], rel=0.15)
    assert deviation["c_J_K"] < 0.1 * prior["c_J_K"]


@pytest.mark.parametrize(
    ("headline", "said"),
    [("changed: rtd_lag", "compared with these directly: changed: rtd_lag"),
     ("", "Record that once more with the same inputs")],
)  # fmt: skip
def test_runs_that_repeat_good_ones_are_told_on_the_terminal_and_the_page(
    found: Diagnosis, headline: str, said: str
) -> None:
    both = replace(found, repeated=RepeatedRecord(["now repeats then"], 2, headline=headline))
    assert Diagnosis.from_json(both.to_json()) == both
    for text in ("\n".join(summary_lines(both)), render(page_of(both))):
        assert said in text
        assert "now repeats then" in text


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
    assert re.findall(r"""(?:src|href)=["'](?!#|data:)|url\((?!#)|@import""", html) == []
    assert html.count("<svg") >= 3
    assert html.count('class="panels"') >= 1


def test_a_notebook_shows_the_verdict(found: Diagnosis) -> None:
    html = found._repr_html_()
    assert found.verdict.outcome in html
    assert found.values[0].name in html


def test_a_record_with_numbers_that_are_none_reads_back_and_writes_the_same(
    found: Diagnosis,
) -> None:
    nan = float("nan")
    told = replace(
        found,
        verdict=replace(found.verdict, ceiling=nan, gap_instead=None, open_loop=[1.0, nan]),
        values=[replace(v, low=float("-inf"), profile=[(nan, 1.0)]) for v in found.values],
        places={"coupling": {"": nan, "backlash": 0.5}},
    )
    again = Diagnosis.from_json(told.to_json())
    assert np.isnan(again.verdict.ceiling)
    assert np.isnan(again.values[0].low)
    assert np.isnan(again.values[0].profile[0][0])
    assert np.isnan(again.places["coupling"][""])
    assert again.verdict.gap_instead is None
    assert again.to_json() == told.to_json()


def test_every_outcome_makes_a_page() -> None:
    for diagnosis in (ask(bank()), ask([recorded("random", 1).part(0, 30)])):
        assert "Gap diagnosis" in render(page_of(diagnosis))
        assert summary_lines(diagnosis)[1] == diagnosis.verdict.plain


def test_the_waterfall_falls_from_raw_over_the_refit_to_the_floor(found: Diagnosis) -> None:
    for view in ("open loop", "local"):
        total = next(r for r in found.waterfall if r.view == view and not r.output)
        assert total.raw >= total.refit > 3 * total.effects[-1]
    assert found.steps == [["coupling"]]


def test_the_text_gives_the_numbers_of_the_record(found: Diagnosis) -> None:
    v = found.verdict
    assert f"{v.gap_raw:.1f}×" in v.text
    assert f"shrink: {v.shrink:.2f} " in v.text
    assert f"probability: {v.probability:.2f}" in v.text


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
    mounting = {"side_resistance": 0.03, "displacement_zero": -0.4}
    theta = {"flow_max": 1.2e-7, "side_flow": 0.04} | mounting
    point = ModelPoint(theta, {"rtd_lag": {"tau_s": 0.3}})
    plant.save_model(point, tmp_path / "model.toml", "a note")
    back = plant.load_model(tmp_path / "model.toml")
    assert back.theta["flow_max"] == pytest.approx(1.2e-7)
    assert back.effects["rtd_lag"]["tau_s"] == pytest.approx(0.3)
    assert back.effects["uneven_flow"]["share"] == pytest.approx(0.04)
    assert {name: back.theta[name] for name in mounting} == mounting
    with pytest.raises(PlantMismatch, match="another variant"):
        SmaPlant(variant="printed").load_model(tmp_path / "model.toml")


def test_weak_excitation_leaves_two_causes_and_the_proposal_tells_them_apart() -> None:
    """A late dial and a dial with play look alike in a slow ramp that turns once."""
    from smad.gap.fit.joint import Start, joint_fits
    from smad.gap.fit.stages import prepare

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
        experiment = next(e for e in plant.catalogue() if e.name == p.name)
        trial = Trial(fits, [0.5, 0.5], experiment, prepared.noise)
        assert 0.0 < trial.separation() == p.counted == p.separation <= trial.bound
    fewer = propose(fits, [0.5, 0.5], prepared.noise, plant.catalogue(), share=0.1)
    assert [q.name for q in fewer] == [p.name for p in proposals]
    assert [q.counted for q in fewer] == [pytest.approx(0.1 * p.separation) for p in proposals]


def test_different_experiments_add_up_to_a_separation_or_do_not() -> None:
    assert enough([9.0, 7.0, 1.0], 16.0) == 2
    assert enough([16.0], 16.0) == 1
    assert enough([9.0, 6.9], 16.0) is None
    assert enough([], 16.0) is None


def test_a_separation_counts_by_how_much_more_than_expected_the_runs_vary_along_it() -> None:
    """A background nine times as strong as Σ says leaves a ninth; one of its size leaves all."""
    from smad.gap.fit.lsq import Problem
    from smad.gap.model.whiten import OutputNoise, Whitening

    from smad.diagnosis.data.grid import Dataset
    from smad.diagnosis.data.views import local_views

    class Plain(Problem):
        def row_weight(self, z: Array, heat: float = 1.0) -> Array:
            return np.ones(len(z))

    plant = HeaterPlant()
    runs = [recorded("random", s, OTHER) for s in (1, 2, 3)]
    ev = Dataset(plant, runs, local_views(plant), Settings(), None)
    problem = Plain(ev, Whitening(ev, {k: OutputNoise(1.0) for k in ev.keys}), np.zeros(ev.n))
    rng = np.random.default_rng(4)
    change = np.repeat(rng.standard_normal(-(-ev.n // 3)), 3)[: ev.n]

    def standing(left: Array) -> Hypothesis:
        no_slopes = np.zeros((ev.n, 0), np.float32)
        fit = FitResult(problem, Space(()), np.zeros(0), left, left, no_slopes, 0.0, ())
        return Hypothesis(JointFit(fit, ()), Judged(problem, None, ev.measured - left, np.zeros(0)))

    white = rng.standard_normal(ev.n) * ev.valid
    shares = [
        counted_share(standing(size * white), standing(size * white + change))
        for size in (1.0, 3.0)
    ]
    assert 0.8 < shares[0] <= 1.0
    assert shares[1] == pytest.approx(shares[0] / 9.0, rel=0.2)
    assert counted_share(standing(0.0 * white), standing(change)) == 0.0


def test_two_causes_that_look_alike_are_told_apart_by_the_experiment_that_is_recommended() -> None:
    before = ask_alike()
    assert before.verdict.outcome is Outcome.AMBIGUOUS
    assert {*before.verdict.effects, *before.verdict.group} == {"backlash", "dial_delay"}
    first = before.experiments[0]
    assert first.counted is not None
    assert 16.0 < first.counted <= first.separation
    assert first.together == first.counted
    said = f"next experiment: {first.title} (60 s); separation d² ≈ {first.counted:.1f}"
    assert said in before.verdict.text
    assert "together" in render(page_of(before))
    after = ask_alike([recorded(first.name, 9, OTHER, ALIKE)])
    assert after.verdict.outcome is Outcome.EFFECT
    assert after.verdict.effects == ["backlash"]
    assert after.experiments == []


def test_experiments_that_do_not_add_up_are_not_promised() -> None:
    def proposed(*counted: float) -> list[ExperimentRecord]:
        sums = np.cumsum(counted).tolist()
        return [
            ExperimentRecord(f"e{i}", f"move {i}", 60.0, 10.0 * own, "run it", own, so_far)
            for i, (own, so_far) in enumerate(zip(counted, sums, strict=True))
        ]

    def said(*counted: float, settled: bool = True) -> str:
        return next_line(proposed(*counted), 16.0, settled=settled)[1]

    assert said(20.0, 5.0) == "move 0 (60 s); separation d² ≈ 20.0"
    assert said(9.0, 8.0, 7.0) == "move 0 (60 s), then move 1 (60 s); separation d² ≈ 17.0"
    assert said(3.0, 2.0) == (
        "move 0 (60 s), but not even the 2 best of the catalogue together are likely to tell them "
        "apart (d² ≈ 5.0 of the 16 needed)"
    )
    assert said() == "none needed"
    assert "none to propose" in said(settled=False)


def test_a_model_of_another_parameter_file_is_not_loaded(tmp_path: Path) -> None:
    plant = SmaPlant(load_parameters("A").replace(work_share=1.0))
    plant.save_model(ModelPoint({}), tmp_path / "model.toml", "")
    assert plant.load_model(tmp_path / "model.toml").theta
    with pytest.raises(PlantMismatch, match="work_share differs"):
        SmaPlant().load_model(tmp_path / "model.toml")


def test_a_plant_without_experiments_is_diagnosed_and_none_is_proposed() -> None:
    found = ask_alike(plant=WithoutExperiments())
    assert found.verdict.outcome is Outcome.AMBIGUOUS
    assert found.experiments == []
    with pytest.raises(GapError, match="performs no experiments"):
        performed(WithoutExperiments(), "one side", ModelPoint({}), 0)  # type: ignore[arg-type]
