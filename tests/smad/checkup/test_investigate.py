"""What is played next, and why; and the loop until one rival is left."""

from dataclasses import replace
from itertools import count
from pathlib import Path

import msgspec
import numpy as np
import pytest

from evaluation.programme.segments import run_of
from sim_device.plant.laws import Factor, Law, Term
from smad.checkup.check import proposed
from smad.checkup.errors import BaselineError
from smad.checkup.investigation import (
    REPORT,
    Investigation,
    Report,
    open_folder,
    read_report,
)
from smad.checkup.judge import Judgement, commissioned, judge_runs
from smad.checkup.programme import Programme, ProgrammeRun
from smad.checkup.proposal import propose, unpaired_offers
from smad.checkup.series import Recorded
from smad.checkup.store import Baseline, save
from smad.diagnosis.answer import gaps_on
from smad.diagnosis.paired.difference import pair_runs
from smad.diagnosis.paired.good import GoodRuns
from smad.diagnosis.places.bare import with_places
from smad.diagnosis.plant import EffectValues, ModelPoint
from smad.diagnosis.rivals.fit import Fit
from smad.diagnosis.rivals.rival import Rival, free_model
from smad.diagnosis.runs import GapRun
from smad.diagnosis.verdict import Cause
from smad.runlog.header import RunHeader
from smad.runlog.schema import Row
from smad.runlog.writer import write_run

from .short import PLANT, SHORT, played

STILL = run_of(
    "still", "hardly anything", [(1.0, 0, 0, 0, 0), (6.0, 0, 0, 0.3, 0), (1.0, 0, 0, 0, 0)]
)
PROGRAMME = Programme("short", "two runs", (replace(SHORT, quick=True), STILL))
ALL_QUICK = replace(PROGRAMME, runs=tuple(replace(run, quick=True) for run in PROGRAMME.runs))
LAG = {"rtd_lag": {"tau_s": 0.1, "y_share": 1.0}}
GAIN = {"driver_gain": {"gain": 0.06, "y_share": 1.0}}
UNCHANGED = "every run of the baseline was played: nothing has changed beyond the repeat floor"
COSTS = {"short": 60.0, "still": 60.0}


@pytest.fixture(scope="module")
def reference() -> GoodRuns:
    groups = [
        [played(10 * k + seed, what=run) for seed in (1, 2, 3)]
        for k, run in enumerate(PROGRAMME.runs)
    ]
    return commissioned(PLANT, groups)


@pytest.fixture(scope="module")
def lagging(reference: GoodRuns) -> Judgement:
    """A check-up of the run that shows little, on a bench with a lag."""
    return judge_runs(PLANT, reference, [(played(40, LAG, what=STILL), "still")])


def law(place: str, side: str, slope: float, state: str = "current") -> Law:
    """A law along one state."""
    line = Factor(state=state, low=0.0, high=3.0, centre=0.0, scale=1.0)
    return Law(place, side, (Term(name=state, factors=(line,), coefficient=slope),))


LAG_LIKE, FORCE_LIKE = law("reading_rtd", "x", 1.0), law("reading_force", "both", 0.1)
SMALL = law("reading_force", "both", 1e-4)


def undecided(found: Judgement, *laws: Law) -> Judgement:
    """The check-up with a cause told, and these laws between which nothing is decided."""
    cause = Cause(
        kind="law",
        name="",
        place=laws[0].place,
        words=laws[0].place,
        probability=0.9,
        names={},
        outside=1.0,
        credible_names=[],
        credible_places=[laws[0].place],
        places={},
        place_words={},
        values=[],
        terms=[],
        unit="K",
        gap=1.0,
        rivals=[],
    )
    point = found.pairs.good.point
    rivals = [
        rival(found, f"{law.place} {k}", replace(point, laws=(law,))) for k, law in enumerate(laws)
    ]
    verdict = msgspec.structs.replace(found.verdict, outcome="causes", causes=[cause])
    return replace(found, verdict=verdict, alternatives=tuple(rivals))


def rival(found: Judgement, name: str, point: ModelPoint) -> Rival:
    """A rival of a check-up whose simulator is at a point."""
    model, none = free_model(found.pairs.plant, point), np.zeros((0, 0))
    made = Fit(
        model=model,
        x=np.zeros(model.parameters),
        residual=none,
        slopes=none,
        linearized_at=np.zeros(model.parameters),
        objective=0.0,
        shift=(),
    )
    return Rival(kind="effect", name=name, fit=made, squares=none, scores=none)


def test_a_run_separates_a_lag_by_the_measured_course_not_by_that_of_the_model(
    lagging: Judgement,
) -> None:
    pairs, good = lagging.pairs, lagging.pairs.good
    wavy = [np.array(run.mean) for run in good.runs]
    for mean in wavy:
        mean[:, 4] += 3.0 * np.sin(np.arange(len(mean)))
    runs = tuple(replace(run, mean=mean) for run, mean in zip(good.runs, wavy, strict=True))
    as_measured = replace(lagging, pairs=replace(pairs, good=replace(good, runs=runs)))
    lag, other = (
        rival(lagging, "rtd_lag", replace(good.point, effects=LAG)),
        rival(lagging, "other", replace(good.point, laws=(SMALL,))),
    )
    of_model, of_readings = (
        propose(replace(undecided(found, SMALL), alternatives=(lag, other)), COSTS, 600.0)
        for found in (lagging, as_measured)
    )
    assert max(of_readings.offers.values()) > 2.0 * max(of_model.offers.values())


def test_the_run_that_tells_rivals_apart_is_proposed_with_the_reason(lagging: Judgement) -> None:
    found = propose(undecided(lagging, LAG_LIKE, FORCE_LIKE), COSTS, 600.0)
    assert found.run == "short"
    assert found.staying == ("reading_rtd 0", "reading_force 1")
    assert list(found.offers) == ["short"]
    assert "it separates reading_rtd 0 or reading_force 1 best" in found.why


@pytest.mark.parametrize("outcome", ["quiet", "unexplained", "parameters"])
def test_without_a_cause_it_is_not_over_before_every_run_was_played(
    lagging: Judgement, outcome: str
) -> None:
    nowhere = msgspec.structs.replace(lagging.verdict, outcome=outcome, causes=[])
    unplaced = replace(lagging, verdict=nowhere)
    found = propose(unplaced, COSTS, 600.0)
    assert found.run == "short"
    assert "for the first time now" in found.why
    late = propose(unplaced, COSTS, 30.0)
    assert late.run is None
    assert late.why.startswith("the time is spent: so far ")
    assert late.why.endswith("; not played: short")


@pytest.mark.parametrize(
    ("outcome", "why"),
    [
        ("quiet", "every run of the baseline was played: nothing has changed beyond the repeat "
         "floor"),
        ("parameters", "every run of the baseline was played: other values of the parameters "
         "explain it, or an effect that they imitate"),
        ("unexplained", "every run of the baseline was played: no cause was found"),
    ],
)  # fmt: skip
def test_without_a_cause_nothing_more_is_played_once_every_run_was(
    lagging: Judgement, outcome: str, why: str
) -> None:
    nowhere = msgspec.structs.replace(lagging.verdict, outcome=outcome, causes=[])
    played = [pair.then for pair in lagging.pairs.pairs]
    pairs = replace(lagging.pairs, good=replace(lagging.pairs.good, runs=tuple(played)))
    found = propose(replace(lagging, verdict=nowhere, pairs=pairs), COSTS, 600.0)
    assert (found.run, found.why) == (None, why)


def test_one_rival_that_no_other_is_near_is_said_with_its_probability(lagging: Judgement) -> None:
    found = propose(undecided(lagging, LAG_LIKE), COSTS, 600.0)
    assert found.run is None
    assert not found.staying
    assert found.why == "one rival is left: reading_rtd, probability 0.90; no other is near"


def test_rivals_that_predict_the_same_are_not_played_for(lagging: Judgement) -> None:
    found = propose(undecided(lagging, SMALL, SMALL), COSTS, 600.0)
    assert found.run is None
    assert found.staying
    assert "no remaining run separates" in found.why


def test_a_run_that_takes_longer_than_is_left_is_told_and_not_played(lagging: Judgement) -> None:
    found = propose(undecided(lagging, LAG_LIKE, FORCE_LIKE), COSTS, 30.0)
    assert found.run is None
    assert "the time is spent: short would separate" in found.why


def test_a_run_is_played_once_whatever_stays(reference: GoodRuns) -> None:
    runs = [(played(40 + k, LAG, what=run), run.name) for k, run in enumerate(PROGRAMME.runs)]
    found = propose(
        undecided(judge_runs(PLANT, reference, runs), LAG_LIKE, FORCE_LIKE), COSTS, 600.0
    )
    assert found.run is None
    assert found.staying
    assert found.why.startswith("every run of the baseline was played")


def test_a_run_that_the_baseline_lacks_is_offered_by_what_the_model_expects(
    lagging: Judgement,
) -> None:
    other = replace(SHORT, name="other")
    programme = Programme("short", "three runs", (*PROGRAMME.runs, other))
    offers = unpaired_offers(undecided(lagging, LAG_LIKE, FORCE_LIKE), programme)
    ((run, separation),) = offers.items()
    assert run == "other"
    assert separation > 16.0


def write_log(path: Path, run: GapRun) -> None:
    columns = {"t_s": run.t_s, **run.inputs, **run.outputs}
    rows = [
        Row(**dict(zip(columns, values, strict=True)))
        for values in zip(*(c.tolist() for c in columns.values()), strict=True)
    ]
    write_run(path, RunHeader(source="sim", rate_hz=100.0), rows)


def inquiry(
    reference: GoodRuns,
    folder: Path,
    effects: EffectValues,
    *,
    fails_at: int = 0,
    trips_at: int = 0,
    leaves_at: int = 0,
) -> Investigation:
    """An investigation of a simulated bench with effects.

    The run number `fails_at` is lost, that of number `trips_at` is ended by a fault, that of number
    `leaves_at` because a reading is too far from the recorded one.
    """
    number = count(1)

    def play(run: ProgrammeRun, original: Path | None) -> Recorded:
        k = next(number)
        if k == fails_at:
            raise ConnectionError("the daemon went away")
        log = folder.parent / "played.mcap"
        log.unlink(missing_ok=True)
        write_log(log, played(60 + k, effects, what=run))
        ended = {trips_at: "it tripped", leaves_at: "it left"}.get(k, "")
        return Recorded(log, ended, k == trips_at, took_s=60.0)

    return Investigation(
        plant=PLANT,
        reference=reference,
        programme=PROGRAMME,
        originals=folder,
        folder=folder,
        play=play,
        say=lambda text: None,
        seconds=600.0,
    )


def test_an_investigation_names_the_cause_proves_it_and_writes_the_model(
    reference: GoodRuns, tmp_path: Path
) -> None:
    folder = tmp_path / "investigation-1"
    report = inquiry(reference, folder, GAIN).carry_out(lambda text: None)
    assert report.verdict is not None
    assert [c.name for c in report.verdict.causes] == ["driver_gain"]
    assert [r.held_out for r in report.records] == [False, True]
    current = next(s for s in report.proof if s.signal == "i_meas_x_A")
    assert current.raw > 5.0 * current.floor
    assert current.final < 2.0 * current.floor
    assert PLANT.load_model(Path(report.model)).effects["driver_gain"]["gain"] == (
        pytest.approx(0.06, rel=0.1)
    )
    assert msgspec.json.decode((folder / "investigation.json").read_bytes(), type=Report) == report


def test_a_model_that_was_found_on_more_runs_than_prove_it_is_proved(reference: GoodRuns) -> None:
    runs = [(played(70 + k, GAIN, what=run), run.name) for k, run in enumerate(PROGRAMME.runs)]
    answer = judge_runs(PLANT, reference, runs)
    pairs = pair_runs(with_places(PLANT), reference, [(played(72, GAIN, what=SHORT), "short")])
    gap = next(s for s in gaps_on(answer, pairs.evidence()) if s.signal == "i_meas_x_A")
    assert gap.raw > 5.0 * gap.floor
    assert gap.final < 2.0 * gap.floor


def test_an_investigation_that_lost_its_bench_goes_on_with_what_it_has(
    reference: GoodRuns, tmp_path: Path
) -> None:
    folder = tmp_path / "investigation-1"
    with pytest.raises(ConnectionError):
        inquiry(reference, folder, GAIN, fails_at=2).carry_out(lambda text: None)
    report = inquiry(reference, folder, GAIN).carry_out(lambda text: None)
    assert [r.file for r in report.records] == ["01-short.mcap", "02-short.mcap"]
    assert report.proof


def test_a_bench_that_trips_is_judged_by_what_was_recorded_and_asked_no_more(
    reference: GoodRuns, tmp_path: Path
) -> None:
    asked = inquiry(reference, tmp_path / "investigation-1", GAIN, trips_at=1)
    report = replace(asked, programme=ALL_QUICK).carry_out(lambda text: None)
    assert [r.run for r in report.records] == ["short"]
    assert report.why_over == "a run was ended early: it tripped"
    assert report.verdict is not None
    assert [c.name for c in report.verdict.causes] == ["driver_gain"]
    assert report.proof == []


def test_an_investigation_whose_runs_end_at_once_says_why_and_the_next_one_begins_anew(
    reference: GoodRuns, tmp_path: Path
) -> None:
    folder = tmp_path / "investigation-1"

    def play(run: ProgrammeRun, original: Path | None) -> Recorded:
        log = tmp_path / "played.mcap"
        log.unlink(missing_ok=True)
        whole = played(61, GAIN, what=run)
        write_log(log, whole.part(0, 70))
        return Recorded(log, f"{run.name} stands elsewhere", False, took_s=60.0)

    asked = replace(inquiry(reference, folder, GAIN), programme=ALL_QUICK, play=play)
    with pytest.raises(BaselineError, match="too little was recorded") as raised:
        asked.carry_out(lambda text: None)
    assert "short was ended early: short stands elsewhere" in raised.value.cause
    assert "16 or more" in str(raised.value)
    report = read_report(folder / REPORT)
    assert report.why_over == raised.value.cause
    assert [r.run for r in report.records] == ["short", "still"]
    assert open_folder(tmp_path).name == "investigation-2"


def test_a_proof_that_ends_at_once_leaves_the_verdict_as_it_was(
    reference: GoodRuns, tmp_path: Path
) -> None:
    asked = inquiry(reference, tmp_path / "investigation-1", GAIN)
    number = count(1)

    def play(run: ProgrammeRun, original: Path | None) -> Recorded:
        recorded = asked.play(run, original)
        if next(number) > 1:
            recorded.path.unlink()
            write_log(recorded.path, played(62, GAIN, what=run).part(0, 70))
        return recorded

    said: list[str] = []
    report = replace(asked, play=play, say=said.append).carry_out(lambda text: None)
    assert report.verdict is not None
    assert [c.name for c in report.verdict.causes] == ["driver_gain"]
    assert [r.held_out for r in report.records] == [False, True]
    assert report.proof == []
    assert any(text.startswith("no proof: too little was recorded") for text in said)


def test_a_bench_that_leaves_a_recorded_run_is_asked_for_the_others(
    reference: GoodRuns, tmp_path: Path
) -> None:
    asked = inquiry(reference, tmp_path / "investigation-1", GAIN, leaves_at=1)
    report = replace(asked, programme=ALL_QUICK).carry_out(lambda text: None)
    assert [r.run for r in report.records if not r.held_out] == ["short", "still"]
    assert [r.ended for r in report.records][:2] == ["it left", ""]
    assert not report.why_over.startswith("a run was ended early")
    assert report.proof


@pytest.mark.parametrize(("ended", "plays_on"), [("it tripped or left", False), ("", True)])
def test_an_old_report_that_does_not_know_of_a_trip_is_told_and_not_played_on(
    reference: GoodRuns, tmp_path: Path, ended: str, *, plays_on: bool
) -> None:
    folder = tmp_path / "investigation-1"
    with pytest.raises(ConnectionError):
        inquiry(reference, folder, GAIN, fails_at=2).carry_out(lambda text: None)
    path = folder / "investigation.json"
    old = msgspec.json.decode(path.read_bytes())
    del old["records"][0]["tripped"]
    old["records"][0]["ended"] = ended
    path.write_bytes(msgspec.json.encode(old))
    said: list[str] = []
    asked = replace(inquiry(reference, folder, GAIN), say=said.append)
    report = asked.carry_out(lambda text: None)
    assert (len(report.records) > 1) == plays_on
    assert report.verdict is not None
    assert [c.name for c in report.verdict.causes] == ["driver_gain"]
    if not plays_on:
        why = (
            "a run was ended early: it tripped or left; whether that was a fault, its "
            "investigation.json is too old to say"
        )
        assert report.why_over == why
        assert why in said


def test_a_report_that_was_torn_is_told_with_what_to_do(
    reference: GoodRuns, tmp_path: Path
) -> None:
    folder = tmp_path / "investigation-1"
    folder.mkdir()
    (folder / "investigation.json").write_text('{"records": [')
    with pytest.raises(BaselineError, match=r"cannot be read.*move .*investigation-1 away"):
        inquiry(reference, folder, GAIN).carry_out(lambda text: None)


def test_what_to_play_next_follows_from_the_runs_that_an_investigation_judged(
    reference: GoodRuns, tmp_path: Path
) -> None:
    save(Baseline("bench", "digest", reference), PLANT, tmp_path)
    report = inquiry(reference, tmp_path / "investigation-1", GAIN).carry_out(lambda text: None)
    assert [r.held_out for r in report.records] == [False, True]
    judgement, _ = proposed(tmp_path, PLANT, lambda text: None)
    assert report.verdict is not None
    assert [r.repeats for r in judgement.verdict.runs] == ["short"]
    assert judgement.verdict.headline == report.verdict.headline


def test_a_quiet_bench_needs_no_proof(reference: GoodRuns, tmp_path: Path) -> None:
    report = inquiry(reference, tmp_path / "investigation-1", {}).carry_out(lambda text: None)
    assert report.why_over == UNCHANGED
    assert (len(report.records), report.proof, report.model) == (2, [], "")


def test_while_nothing_is_found_no_time_is_kept_for_a_proof(
    reference: GoodRuns, tmp_path: Path
) -> None:
    asked = replace(inquiry(reference, tmp_path / "investigation-1", {}), seconds=130.0)
    report = asked.carry_out(lambda text: None)
    assert [r.run for r in report.records] == ["short", "still"]
    assert report.why_over == UNCHANGED


def test_a_proof_does_not_take_longer_than_is_left(reference: GoodRuns, tmp_path: Path) -> None:
    asked = replace(inquiry(reference, tmp_path / "investigation-1", GAIN), seconds=110.0)
    report = asked.carry_out(lambda text: None)
    assert [r.held_out for r in report.records] == [False]
    assert report.spent_s <= 110.0
    assert report.proof == []
    assert report.model
