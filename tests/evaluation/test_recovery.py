"""The recovery bank: its cases, its file, its scores, and a small part of it asked in earnest."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from evaluation.command import main
from evaluation.recovery import judging
from evaluation.recovery.cases import (
    NONE,
    PAIR,
    PARAMETERS,
    QUESTIONS,
    SINGLE,
    THIRD,
    Case,
    bench_parameters,
    cases_of,
)
from evaluation.recovery.judging import Answer, answer
from evaluation.recovery.playing import FIT, Bench
from evaluation.recovery.running import answered, begun, read
from evaluation.recovery.scores import first_name, identifiable, near, tables
from smad.diagnosis.spring_pair import SmaPlant
from smad.diagnosis.verdict import CAUSES, CHANGED, CHECK_UP, DIFFERS, SignalGap, Verdict
from tests.evaluation.reported import effect_reported

LAG = {"rtd_lag": {"tau_s": 0.6, "y_share": 1.0}}


@pytest.fixture(scope="module")
def plant() -> SmaPlant:
    return SmaPlant()


def test_each_effect_acts_alone_at_two_strengths_in_two_benches(plant: SmaPlant) -> None:
    cases = cases_of(plant, QUESTIONS, seed=1)
    for question in QUESTIONS:
        own = [c for c in cases if c.question == question and c.kind == SINGLE]
        assert {n for c in own for n in c.effects} == {e.name for e in plant.effects}
        lag = [c for c in own if "rtd_lag" in c.effects]
        assert len(lag) == 8
        assert {c.effects["rtd_lag"]["tau_s"] for c in lag} == {0.6, 0.6 * THIRD}
        assert {(c.bench > 0, c.side, c.effects["rtd_lag"]["y_share"]) for c in lag} == {
            (moved, side, share)
            for moved in (False, True)
            for side, share in (("both", 1.0), ("x", 0.0))
        }
        assert len([c for c in cases if c.question == question and c.kind == PAIR]) == 20
    assert len({c.name for c in cases}) == len(cases)


def test_the_first_cases_of_a_bank_are_of_every_kind_and_the_same_again(plant: SmaPlant) -> None:
    some = cases_of(plant, [DIFFERS], seed=1, count=12)
    assert {c.kind for c in some} == {SINGLE, PAIR, NONE, PARAMETERS}
    assert some == cases_of(plant, [DIFFERS], seed=1)[:12]
    assert some != cases_of(plant, [DIFFERS], seed=2, count=12)


def test_a_moved_bench_differs_by_half_a_prior_deviation_and_stays_in_range(
    plant: SmaPlant,
) -> None:
    case = Case(name="a", question=DIFFERS, kind=NONE, seed=3, bench=5)
    _, now = bench_parameters(plant, case, seed=1)
    for q in plant.parameters:
        off = abs(now[q.name] - q.nominal) / q.prior_sd
        at_bound = now[q.name] in (q.low, q.high)
        assert off == pytest.approx(0.5) or off == 0.0 or at_bound
        assert q.low <= now[q.name] <= q.high
    assert sum(now[q.name] != q.nominal for q in plant.parameters) > 20


def test_parameters_change_between_good_runs_and_now_only_where_that_is_the_question(
    plant: SmaPlant,
) -> None:
    for kind, question, same in (
        (PARAMETERS, CHANGED, False), (PARAMETERS, CHECK_UP, False), (PARAMETERS, DIFFERS, True),
        (NONE, CHANGED, True),
    ):  # fmt: skip
        case = Case(name="a", question=question, kind=kind, seed=3, bench=1)
        good, now = bench_parameters(plant, case, seed=1)
        assert (good == now) == same


def reported(case: Case, *names: str, left: float = 0.7, parameters: float = 9.0) -> Answer:
    """An answer that tells some effects."""
    causes = [effect_reported(name, "reading_rtd", gap=left) for name in names]
    whole = SignalGap(
        signal="all",
        unit="floors",
        floor=1.0,
        raw=20.0,
        parameters=parameters,
        causes=[left] * len(names),
    )
    outcome = CAUSES if causes else "quiet"
    verdict = Verdict(question=DIFFERS, outcome=outcome, headline="", causes=causes, whole=whole)
    return Answer(case=case, verdict=verdict, cpu_s=3.0)


def single(name: str, kind: str = SINGLE) -> Case:
    effects = LAG if kind == SINGLE else {}
    return Case(name=name, question=DIFFERS, kind=kind, seed=1, effects=effects, strength=1.0)  # type: ignore[arg-type]


def test_scores_are_given_with_and_without_what_parameters_imitate() -> None:
    answers = [
        reported(single("a"), "rtd_lag"),
        reported(single("b"), parameters=1.1),
        reported(single("c"), "rtd_offset", left=5.0),
        reported(single("d", NONE)),
        reported(single("e", NONE), "rtd_lag"),
        Answer(case=single("f", NONE), error="broken"),
    ]
    found = tables(answers)
    rows = {r[0]: r for r in found["Recovery, differs"].rows}
    assert rows["right name reported"][1].startswith("0.33")
    assert rows["right name reported"][3].startswith("0.50")
    assert (rows["right name reported"][2], rows["right name reported"][4]) == ("3", "2")
    assert rows["nothing called something"][1].startswith("0.67")
    wrong = found["Recovery, differs: wrong, missed or indistinguishable"].rows
    assert [r[0] for r in wrong] == ["b", "c", "e", "f"]
    apart = {r[0]: r[1:3] for r in found["Recovery, differs: single effects apart"].rows}
    assert apart["typical strength"] == ("3", "1")


def test_a_pair_cannot_be_reported_where_one_of_it_leaves_nothing_to_see() -> None:
    effects = LAG | {"force_gain": {"gain": 0.1}}
    pair = Case(name="a", question=DIFFERS, kind=PAIR, seed=1, effects=effects, strength=1.0)
    assert not identifiable(reported(pair, "rtd_lag", left=0.7))
    assert identifiable(reported(pair, "rtd_lag", left=2.0))
    assert identifiable(reported(pair, "tube_friction", left=0.7))
    assert not identifiable(reported(pair, parameters=1.1))


def test_a_bank_goes_on_from_its_file_and_tries_failed_cases_again(tmp_path: Path) -> None:
    path, asked = tmp_path / "answers.json", list[str]()

    def work(case: Case, seed: int) -> Answer:
        asked.append(case.name)
        broken = case.name == "b" and asked.count("b") == 1
        return Answer(case=case, error="broken") if broken else reported(case, "rtd_lag")

    cases = [single(n) for n in "abc"]
    with ThreadPoolExecutor(1) as pool:
        for some in (cases[:2], cases, cases):
            answered(begun(path, 1), path, some, pool, work)
        assert asked == ["a", "b", "b", "c"]
        assert set(read(path).answers) == {"a", "b", "c"}
        answered(begun(path, 2), path, cases[:1], pool, work)
    assert asked[-1] == "a"
    assert set(read(path).answers) == {"a"}


@pytest.mark.parametrize(
    ("arguments", "said"),
    [(("--only", "why"), "differs, changed, check-up"), (("--cases", "0"), "--cases 1 or more")],
)
def test_wrong_options_are_refused(
    arguments: tuple[str, ...], said: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit, match="2"):
        main(["recover", str(tmp_path / "a.json"), *arguments])
    assert said in capsys.readouterr().err


def test_a_lag_is_found_by_name_and_a_healthy_bench_is_quiet(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(judging, "FIT", ("levels",))
    monkeypatch.setattr(judging, "HELD_OUT", ("mixed",))
    found = answer(Case(name="lag", question=DIFFERS, kind=SINGLE, seed=5, effects=LAG), 1)
    assert found.error == ""
    assert first_name(found) == "rtd_lag"
    assert identifiable(found)
    assert near(found)
    quiet = answer(Case(name="none", question=DIFFERS, kind=NONE, seed=6), 1)
    assert quiet.verdict is not None
    assert quiet.verdict.outcome == "quiet"


def test_each_run_begins_where_strokes_that_no_log_has_left_the_bench(plant: SmaPlant) -> None:
    bench = Bench(plant, {q.name: q.nominal for q in plant.parameters}, {})
    runs = [*bench.everyday(FIT, 1), *bench.programme(1, 1)]
    begins_mm = [round(float(run.outputs["displacement_mm"][0]), 1) for run in runs]
    assert len(set(begins_mm)) > 3
    assert 0.5 < max(map(abs, begins_mm)) < 2.0
