"""A small bank through the whole check: made, diagnosed, interrupted, scored, and its oracle."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pyarrow.parquet as pq
import pytest

from smad.cli import execute
from smad.gap.check.bank import open_bank
from smad.gap.check.case import How, Part, Task
from smad.gap.check.names import ALIASES, CAUSES, subsystem_of
from smad.gap.check.running import Order, Progress, check
from smad.gap.check.score import Scores
from smad.gap.check.verdicts import (
    CaseVerdict,
    Hypothesis,
    NextExperiment,
    VerdictFile,
    read_verdict_file,
    read_verdicts,
    write_verdicts,
)
from smad.gap.settings import Settings
from smad.gap.sma import SmaPlant
from tests.withheld import after_next, after_why, best_entry, files, more_runs
from tests.withheld.after_next import recommended
from tests.withheld.cases import Case
from tests.withheld.command import main
from tests.withheld.follow import follow
from tests.withheld.making import Style, make
from tests.withheld.plant.effects import BY_NAME, Active, names
from tests.withheld.quick import quicken
from tests.withheld.reasons import Report, parting
from tests.withheld.second_pass import Frozen, entries, opened

RUN_S = 12.0
LIBRARY = ("rtd_offset", "flow_shortfall")
QUICK = How(settings=Settings(max_effects=1), effects=LIBRARY)
CASES = (
    Case(1, "single", ((Active("rtd_offset", BY_NAME["rtd_offset"].usual, 1.0, 0.5),),), 20.0, 41),
    Case(2, "none", ((),), 0.0, 42),
)


@pytest.fixture(autouse=True)
def short(monkeypatch: pytest.MonkeyPatch) -> None:
    quicken(monkeypatch)


@pytest.fixture(scope="module")
def bank(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A bank of two short cases; its key lies beside it."""
    folder = tmp_path_factory.mktemp("banks") / "small"
    made = {case.name: make(case, folder, Style(RUN_S, search=False)) for case in CASES}
    key_folder = folder.with_name("small-key")
    key_folder.mkdir()
    key = {"format": "smad-key-1", "bank": "small", "cases": {n: k for n, (_, k) in made.items()}}
    files.write_json(key_folder / "KEY.json", key)
    manifest = {
        "format": files.FORMAT,
        "bank": "small",
        "key_sha256": files.digest(key_folder / "KEY.json"),
        "columns": files.UNITS,
        "good": [],
        "cases": [m for m, _ in made.values()],
    }
    files.write_json(folder / "manifest.json", manifest)
    return folder


def test_a_bank_is_judged_interrupted_taken_up_again_and_scored(
    bank: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    opened = open_bank(bank)
    order = Order(opened, opened.manifest.cases, QUICK, tmp_path / "parts")

    def stop(progress: Progress) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        check(order, jobs=1, report=stop)
    told: list[str] = []
    file = check(order, jobs=1, report=lambda p: told.append(p.part.case))
    assert told == ["case-002"]
    assert set(file.verdicts) == {"case-001", "case-002"}
    verdicts, key = tmp_path / "verdicts.json", bank.with_name("small-key") / "KEY.json"
    write_verdicts(verdicts, file)

    found = read_verdicts(verdicts).verdicts["case-001"]
    assert set(found.held_out) >= {"rtd_x_degC", "displacement_mm", "force_N", "v_x_V"}
    assert all(h.floor <= h.refit for h in found.held_out.values())
    assert found.outcome not in ("no_gap", "not_enough_excitation")
    assert {n for h in found.causes for n in h.names} <= {*LIBRARY, "unknown", "parameters"}
    assert set(found.quantities) <= set(found.first)
    assert found.seconds is not None
    assert found.seconds > 0.0

    scores = tmp_path / "scores.json"
    assert execute(["gap", "score", str(verdicts), str(key), "--json", str(scores)]) == 0
    assert "2 of 2 cases answered" in capsys.readouterr().out
    read = msgspec.json.decode(scores.read_bytes(), type=Scores)
    rows = {r.name: r for r in read.table}
    assert rows["detected at 10× the floor"].count == 1
    assert rows["false alarms on none"].count == 1


@pytest.fixture
def frozen(bank: Path, tmp_path: Path) -> Path:
    """Made-up verdicts of the small bank, as if two causes were left of the first case."""
    ambiguous = CaseVerdict(
        outcome="ambiguous",
        causes=[Hypothesis([LIBRARY[0]], 0.6), Hypothesis([LIBRARY[1]], 0.4)],
        group=list(LIBRARY),
        shrink=0.1,
        next_experiment=NextExperiment("one side", list(LIBRARY)),
    )
    file = VerdictFile(
        format="smad-verdicts-1",
        bank="small",
        key_sha256=open_bank(bank).manifest.key_sha256,
        verdicts={"case-001": ambiguous, "case-002": CaseVerdict(outcome="no_gap")},
        tool={"how": msgspec.to_builtins(QUICK)},
    )
    path = tmp_path / "frozen.json"
    write_verdicts(path, file)
    return path


def test_the_oracle_fits_the_right_entry_and_changes_nothing_else(
    bank: Path, frozen: Path, tmp_path: Path
) -> None:
    key, out = bank.with_name("small-key") / "KEY.json", tmp_path / "with-o2.json"
    main(["best-entry", str(frozen), str(key), str(bank), "--out", str(out), "--jobs", "1"])
    before, after = (read_verdict_file(p).verdicts for p in (frozen, out))
    best = after["case-001"].shrink_best_entry
    assert best is not None
    assert -1.0 < best <= 1.0
    assert msgspec.structs.replace(after["case-001"], shrink_best_entry=None) == before["case-001"]
    assert after["case-002"] == before["case-002"]


def test_a_recommended_experiment_is_carried_out_and_the_case_asked_again(
    bank: Path, frozen: Path, tmp_path: Path
) -> None:
    key, out = bank.with_name("small-key") / "KEY.json", tmp_path / "after.json"
    before = sorted(bank.rglob("*"))
    main(["after-next", str(frozen), str(key), str(bank), "--out", str(out), "--jobs", "1"])
    assert sorted(bank.rglob("*")) == before
    (run,) = tmp_path.glob("after.json.*.parts/case-001-one-side-*.parquet")
    log = files.read_run(run)
    assert log["t_s"][-1] - log["t_s"][0] == pytest.approx(60.0, abs=0.5)
    assert log["i_applied_x_A"].max() > 3.0
    assert log["i_applied_y_A"].max() == 0.0
    after = read_verdict_file(out).verdicts
    assert after["case-002"] == CaseVerdict(outcome="no_gap")
    experiment = after["case-001"].next_experiment
    assert experiment is not None
    assert experiment.name == "one side"
    assert experiment.names_after is not None
    assert set(experiment.names_after) <= set(LIBRARY)


def test_no_second_pass_takes_up_answers_about_other_verdicts_or_to_another_question(
    bank: Path, frozen: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file = read_verdict_file(frozen)
    verdicts = dict(file.verdicts)
    verdicts["case-001"] = msgspec.structs.replace(verdicts["case-001"], shrink=0.2)
    other = tmp_path / "other.json"
    write_verdicts(other, msgspec.structs.replace(file, verdicts=verdicts))
    kept: list[Path] = []

    def through(frozen: Frozen, names: list[str], parts: Path, *more: object) -> dict[str, Any]:
        kept.append(parts)
        return {}

    for module in (after_next, best_entry):
        monkeypatch.setattr(module, "through", through)
    monkeypatch.setattr(after_next, "recorded", lambda *told: {})
    key, out = bank.with_name("small-key") / "KEY.json", tmp_path / "out.json"
    for said in (frozen, other):
        for command in ("best-entry", "after-next"):
            main([command, str(said), str(key), str(bank), "--out", str(out)])
    assert len(set(kept)) == 4


def test_half_a_recording_is_recorded_again(
    bank: Path, frozen: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(more_runs, "write_program", _rest)
    key = bank.with_name("small-key") / "KEY.json"
    opened_once = opened(frozen, key, bank)
    failing = [True]

    def record(case: str, program: Path, run: Path, number: int) -> None:
        def cut(table: object, path: Path, **how: object) -> None:
            path.write_bytes(b"PAR1 half of it")
            raise KeyboardInterrupt

        with monkeypatch.context() as during:
            if failing.pop():
                during.setattr(pq, "write_table", cut)
            follow(bank, key, case, program, run, number=number)

    wanted = {"case-001": ["one side"]}
    with pytest.raises(KeyboardInterrupt):
        more_runs.recorded(opened_once, wanted, tmp_path, record)
    failing.append(False)
    (run,) = more_runs.recorded(opened_once, wanted, tmp_path, record)["case-001"]
    assert files.read_run(run)["t_s"][-1] > 7.0


def _rest(plant: SmaPlant, experiment: str, seed: int, path: Path) -> None:
    """In place of the simulated experiment: eight seconds of nothing."""
    path.write_text("t_s,i_x_A\n0,0\n8,0\n")


def test_an_experiment_is_carried_out_where_it_may_give_a_name(bank: Path, frozen: Path) -> None:
    key = bank.with_name("small-key") / "KEY.json"
    opened_once = opened(frozen, key, bank)
    asked = [pair for pair in opened_once.pairs if pair.case == "case-001"]

    def cases(outcome: str) -> list[str]:
        said = msgspec.structs.replace(asked[0].said, outcome=outcome)
        pair = dataclasses.replace(asked[0], said=said)
        return list(recommended(dataclasses.replace(opened_once, pairs=[pair])))

    for outcome in ("ambiguous", "unknown", "parameters_only", "no_gap"):
        assert cases(outcome) == ["case-001"], outcome
    for outcome in ("effect", "effect_plus_rest"):
        assert cases(outcome) == [], outcome


def test_one_program_is_recorded_on_another_day_under_another_number(
    bank: Path, tmp_path: Path
) -> None:
    key, program = bank.with_name("small-key") / "KEY.json", tmp_path / "rest.csv"
    program.write_text("t_s,i_x_A\n0,0\n8,0\n")
    runs = [
        files.read_run(follow(bank, key, "case-001", program, tmp_path / f"{i}.parquet", number=n))
        for i, n in enumerate((1, 1, 2))
    ]
    water = [float(np.nanmean(run["rtd_inlet_degC"])) for run in runs]
    assert water[0] == water[1]
    assert abs(water[2] - water[0]) > 0.02


def _rightly(task: Task, runs: Mapping[str, Sequence[Path]]) -> Part:
    """In place of a diagnosis, which the recommended experiment's test asks for: the right name."""
    assert all(files.read_run(run)["t_s"][-1] > 30.0 for run in runs[task.case.id])
    said = NextExperiment("", names_after=[LIBRARY[0]])
    return Part(task.case.id, 0.0, CaseVerdict(outcome="effect", next_experiment=said))


def test_a_case_without_its_right_name_alone_is_told_why_and_its_experiment_carried_out(
    bank: Path, frozen: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    key, out = bank.with_name("small-key") / "KEY.json", tmp_path / "why.json"
    place = [str(frozen), str(key), str(bank), "--jobs", "1"]
    main(["why", *place, "--out", str(out)])
    said = capsys.readouterr()
    assert "case-001  done in" in said.err
    assert "1 of 1 cases examined" in said.out
    report = msgspec.json.decode(out.read_bytes(), type=Report)
    (case,) = report.cases
    assert case.reason in said.out
    assert case.told.said == sorted(LIBRARY)
    assert case.told.given == [LIBRARY[1]]
    assert case.told.true_background > 1.0
    assert case.told.entry is not None
    assert case.told.entry.name == LIBRARY[0]
    assert report.counts == {case.reason: {"1×": 0, "3×": 0, "10×": 1}}
    assert report.failed == []

    after = tmp_path / "after-why.json"

    def record(case: str, program: Path, run: Path, number: int) -> None:
        follow(bank, key, case, program, run, number=number)

    after_why.run(frozen, key, bank, out, after, jobs=1, follow=record, ask=_rightly)
    way = parting(case.told, Settings())
    assert way is not None
    assert way.enough
    whole = msgspec.json.decode(after.read_bytes(), type=after_why.AgainReport)
    (again,) = whole.cases
    assert again.experiments == way.experiments
    assert (again.counted, again.errors) == (way.counted, way.errors)
    assert (again.outcome, again.names) == ("effect", [LIBRARY[0]])
    assert "named alone" in capsys.readouterr().out
    recorded = tmp_path.glob("after-why.json.*.parts/case-001-*.parquet")
    assert len(list(recorded)) == len(again.experiments)

    other = tmp_path / "other.json"
    other.write_bytes(msgspec.structs.replace(report, verdicts_sha256="0" * 64).to_json())
    older = tmp_path / "older.json"
    older.write_bytes(msgspec.structs.replace(report, format="smad-why-1").to_json())
    oldest = tmp_path / "oldest.json"
    oldest.write_text(json.dumps({"format": "smad-why-1", "cases": [{"told": {}}]}))
    for wrong, said_of_it in (
        (["--report", str(out), "--cases", "case-002"], "case-002 is not a missed or misnamed"),
        (["--report", str(other)], "is about other verdicts"),
        (["--report", str(older)], "is of another version"),
        (["--report", str(oldest)], "is of another version"),
        (["--report", str(bank / "manifest.json")], "is no report of why"),
    ):
        with pytest.raises(SystemExit):
            main(["after-why", *place, *wrong, "--out", str(tmp_path / "x.json")])
        assert said_of_it in capsys.readouterr().err


def test_only_judged_cases_of_one_effect_can_be_asked_for(
    bank: Path, frozen: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    key, out = bank.with_name("small-key") / "KEY.json", tmp_path / "why.json"
    with pytest.raises(SystemExit):
        main(["why", str(frozen), str(key), str(bank), "--out", str(out), "--cases", "case-002"])
    assert "case-002 is not a judged case of one effect" in capsys.readouterr().err
    assert not out.exists()


def test_verdicts_that_smad_did_not_make_have_no_second_pass(
    bank: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    key = bank.with_name("small-key") / "KEY.json"
    file = VerdictFile(
        format="smad-verdicts-1", bank="small", key_sha256=files.digest(key), verdicts={}
    )
    write_verdicts(tmp_path / "v.json", file)
    with pytest.raises(SystemExit):
        main(["best-entry", str(tmp_path / "v.json"), str(key), str(bank), "--out", "x.json"])
    assert "was not made by smad gap check" in capsys.readouterr().err


def test_the_command_judges_a_bank_of_ones_own_without_a_key(
    bank: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    manifest = json.loads((bank / "manifest.json").read_text())
    case = manifest["cases"][1] | {"question": "differs"}
    mine = {"format": "smad-bank-1", "bank": "mine", "cases": [case]}
    (tmp_path / "manifest.json").write_text(json.dumps(mine))
    (tmp_path / "cases").symlink_to(bank / "cases")
    out = tmp_path / "out.json"
    options = ["--effects", "flow_shortfall", "--jobs", "1", "--out", str(out)]
    assert execute(["gap", "check", str(tmp_path), *options]) == 0
    said = capsys.readouterr()
    assert "bank mine: 1 of 1 cases" in said.err
    assert "[1/1, 0 min left]" in said.err
    file = read_verdict_file(out)
    assert file.key_sha256 == ""
    assert execute(["gap", "check", str(tmp_path), *options]) == 0
    assert "1 of them judged before" in capsys.readouterr().err


@pytest.mark.parametrize("command", ["best-entry", "why"])
def test_a_sealed_bank_has_no_second_pass_before_its_verdicts_are_logged(
    bank: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], command: str
) -> None:
    key = json.loads((bank.with_name("small-key") / "KEY.json").read_text()) | {"bank": "sealed"}
    (tmp_path / "KEY.json").write_text(json.dumps(key))
    body = {"format": "smad-verdicts-1", "bank": "sealed", "key_sha256": "0" * 64, "verdicts": {}}
    (tmp_path / "v.json").write_text(json.dumps(body))
    with pytest.raises(SystemExit):
        main([command, str(tmp_path / "v.json"), str(tmp_path / "KEY.json"), str(bank),
              "--out", str(tmp_path / "out.json")])  # fmt: skip
    assert "commit its hash before the first verdict" in capsys.readouterr().err
    assert not (tmp_path / "out.json").exists()


def test_the_product_and_the_bank_name_the_listed_causes_alike() -> None:
    assert set(CAUSES) == set(names("known"))
    assert {n: subsystem_of(n) for n in CAUSES} == {n: BY_NAME[n].subsystem for n in CAUSES}


def test_every_listed_cause_has_an_entry_in_the_library() -> None:
    library = [e.name for e in SmaPlant().effects]
    assert [n for n in CAUSES if not entries(library, n)] == []
    uneven = {"cold_ends", "temperature_spread", "cooling_front"}
    assert set(entries(library, "cold_ends")) == uneven
    assert ALIASES["water_drainage"] == "water_drain"


def test_a_key_in_full_reads_as_the_scorer_wants_it(bank: Path) -> None:
    from smad.gap.check.key import read_key

    key, sha256 = read_key(bank.with_name("small-key") / "KEY.json")
    assert sha256 == open_bank(bank).manifest.key_sha256
    assert key.cases["case-001"].names == {"rtd_offset"}
    assert key.cases["case-001"].effects[0].quantity is not None
    assert key.cases["case-002"].right_answer == {"none"}
    assert msgspec.to_builtins(key.cases["case-002"].effects) == []
