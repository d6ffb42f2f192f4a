"""What is published of a bank, on made-up verdicts whose scores are known by hand."""

import datetime
import hashlib
import json
from pathlib import Path
from typing import Any

import msgspec
import pytest
from smad.gap.records import FittedRecord

from evaluation.command import main
from evaluation.results.page import rendered
from evaluation.results.record import FOLDER, Result, kept
from evaluation.score.baselines import baselines, told_beside
from evaluation.score.goals import Scored
from evaluation.score.openings import Ledger
from evaluation.score.scores import Published, published
from evaluation.score.tables import tables
from smad.diagnosis.bank.errors import KeyMismatchError
from smad.diagnosis.bank.key import FORMAT, file_digest, read_key
from smad.diagnosis.bank.score import Mistake, matched
from smad.diagnosis.bank.verdicts import (
    CaseVerdict,
    HeldOut,
    Short,
    VerdictFile,
    read_verdicts,
    write_verdicts,
)
from smad.diagnosis.spring_pair import SmaPlant
from tests.smad.gap.test_check_score import LAG, SHA, _entry, _key, _named

OPENED = "7190a021eeda81c23647ee7713a967cf1d690b3a2d3908e28a25a6caccf8d6d1"
LINES = 25
"""Of the log of openings when it was last looked at."""


def _rows(key: dict[str, Any], verdicts: dict[str, CaseVerdict]) -> dict[str, Scored]:
    file = VerdictFile(format="smad-verdicts-1", bank="x", key_sha256=SHA, verdicts=verdicts)
    return {r.name: r for r in published(matched(file, _key(key), SHA), "x", {}).table}


def test_a_score_without_a_case_has_a_goal_and_does_not_meet_it() -> None:
    row = _rows({"a": _entry("none")}, {"a": CaseVerdict(outcome="no_gap")})["pairs: exact"]
    assert (row.value, row.goal, row.met) == (None, "≥ 0.4", None)


def test_false_alarms_are_measured_by_their_goal() -> None:
    verdicts = {"a": CaseVerdict(outcome="unknown"), "b": CaseVerdict(outcome="no_gap")}
    row = _rows({"a": _entry("none"), "b": _entry("none")}, verdicts)["false alarms on none"]
    assert (row.value, row.met) == (0.5, False)


def test_a_check_up_has_goals_of_its_own() -> None:
    runs = {f"{i}": _entry("single", LAG) for i in range(10)}
    paired = {c: {**e, "gap_paired": {"rtd_x": 3.0}} for c, e in runs.items()}
    verdicts = {c: _named("rtd_lag" if c != "0" else "rtd_offset") for c in runs}
    name = "right name first, of the detected"
    assert _rows(runs, verdicts)[name].met is True
    assert _rows(paired, verdicts)[name].met is False
    assert _rows(paired, verdicts)[name].goal == "≥ 0.9, interval from 0.85"


def test_baselines_and_confusion_are_reported_beside_ours() -> None:
    key = {"a": _entry("single", LAG), "b": _entry("none")}
    alarm = Short("effect", ["rtd_lag"])
    verdicts = {"a": _named("rtd_lag"), "b": CaseVerdict(outcome="no_gap")}
    file = VerdictFile(format="smad-verdicts-1", bank="x", key_sha256=SHA, verdicts=verdicts)
    beside = {case: {"smallest_rmse": alarm} for case in "ab"}
    found = published(matched(file, _key(key), SHA), "x", beside)
    theirs = {r.name: r.value for r in found.baselines["smallest_rmse"]}
    assert theirs["false alarms on none"] == 1.0
    assert theirs["right name first, of the detected"] == 1.0
    ours = {r.name: r.value for r in found.baselines["the diagnosis"]}
    assert ours["false alarms on none"] == 0.0
    assert found.confusion == {"none": {"no_gap": 1}, "rtd_lag": {"rtd_lag": 1}}


def test_what_the_model_is_trusted_to_is_told_in_the_floors_of_the_bank() -> None:
    floors = {"rtd_x_degC": 0.05, "force_N": 0.004}
    key = {c: _entry("none") | {"floor": floors} for c in "abc"}
    key["d"] = _entry("differs") | {"floor": floors}

    def quiet(rtd: float) -> CaseVerdict:
        held = {"rtd_x_degC": HeldOut(0.3, 0.2, 0.2, rtd), "rtd_y_degC": HeldOut(0.3, 0.2, 0.2, 1)}
        return CaseVerdict(outcome="no_gap", held_out=held)

    verdicts = dict(zip("abcd", map(quiet, (0.1, 0.2, 0.4, 9.0)), strict=True))
    file = VerdictFile(format="smad-verdicts-1", bank="x", key_sha256=SHA, verdicts=verdicts)
    found = published(matched(file, _key(key), SHA), "x", {})
    (rtd,) = found.trusted
    assert (rtd.channel, rtd.cases) == ("rtd_x_degC", 3)
    assert [rtd.low, rtd.median, rtd.high] == pytest.approx([3.0, 4.0, 6.0])
    assert "What the model is trusted to, in floors" in tables(found)


def test_a_sealed_key_that_was_not_committed_is_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    verdicts, key = _scored(tmp_path, "sealed")
    record = Ledger.of().record
    before = record.read_text() if record.exists() else ""
    with pytest.raises(SystemExit):
        main(["score", str(verdicts), str(key)])
    said = capsys.readouterr()
    assert "commit its hash" in said.err
    assert "right name first" not in said.out
    assert (record.read_text() if record.exists() else "") == before


def test_a_sealed_key_is_refused_where_there_is_no_list_of_seals(tmp_path: Path) -> None:
    with pytest.raises(KeyMismatchError, match="checkout of the repository only"):
        Ledger.of(tmp_path).require_sealed(SHA)


def test_the_command_scores_and_keeps_the_result(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    verdicts, key = _scored(tmp_path, "dev")
    out = tmp_path / "dev.json"
    main(["score", str(verdicts), str(key), "--out", str(out), "--note", "of two cases"])
    assert "right name first" in capsys.readouterr().out
    (result,) = kept_in(out)
    _, found = _read(verdicts, key)
    assert result.title == "dev"
    assert result.notes == ["of two cases"]
    assert list(result.tables) == list(tables(found))
    shown = {row[0]: list(row[1:]) for row in result.tables["What was said of what"].rows}
    for truth, said in found.confusion.items():
        assert all(f"{name} ({n})" in shown[truth][1] for name, n in said.items())
    page = rendered([result], tmp_path / "none")
    assert "| right name first, of the detected | 1.000" in page


def kept_in(path: Path) -> list[Result]:
    folder = path.with_suffix("")
    folder.mkdir()
    path.rename(folder / path.name)
    return kept(folder)


def test_a_wrong_answer_is_told_with_its_probability() -> None:
    wrong = Mistake("case-007", "single", ["rtd_lag"], 3.0, ["rtd_offset"], "effect", 0.9)
    found = published([], "dev", {})
    told = tables(msgspec.structs.replace(found, mistakes=[wrong]))["Wrong first answers"]
    assert told.rows == [("case-007", "single", "rtd_lag", "3.0", "effect", "rtd_offset", "0.90")]


def test_every_opening_is_entered_with_date_commit_and_scores(tmp_path: Path) -> None:
    file, found = _read(*_scored(tmp_path, "dev"))
    ledger = Ledger.of(tmp_path)
    when = datetime.datetime(2030, 5, 1, 12, 0, tzinfo=datetime.UTC)
    for _ in range(2):
        ledger.enter(file.key_sha256, "c" * 64, found, commit="abc", now=when)
    assert rendered([], ledger.record).count("| 2030-05-01 12:00 | abc |") == 2
    line = json.loads(ledger.record.read_text().splitlines()[0])
    assert line["scores"]["right name first, of the detected"] == 1.0


def test_no_opening_of_a_sealed_bank_is_taken_back_or_changed() -> None:
    lines = (FOLDER / "openings.jsonl").read_bytes().splitlines(keepends=True)
    assert hashlib.sha256(b"".join(lines[:LINES])).hexdigest() == OPENED


def test_a_day_unlike_the_good_ones_is_no_effect() -> None:
    verdicts = {"a": CaseVerdict(outcome="no_gap"), "b": CaseVerdict(outcome="unknown")}
    rows = _rows({"a": _entry("room"), "b": _entry("room")}, verdicts)
    assert (rows["false alarms: room"].value, rows["false alarms: room"].count) == (0.5, 2)
    assert rows["false alarms on none"].count == 0


def test_shrink_is_told_beside_that_of_the_right_effect() -> None:
    key = {c: _entry("single", LAG) for c in "ab"}
    verdicts = {c: _named("rtd_lag", shrink=s) for c, s in (("a", 0.8), ("b", 0.4))}
    row = _rows(key, verdicts)["median held-out shrink, tool ÷ O1"]
    assert row.value == pytest.approx(0.6 / 0.9)


def _scored(tmp_path: Path, bank: str) -> tuple[Path, Path]:
    key_path = tmp_path / "KEY.json"
    cases = {"a": _entry("single", LAG), "b": _entry("none")}
    key_path.write_text(json.dumps({"format": FORMAT, "bank": bank, "cases": cases}))
    verdicts = {"a": _named("rtd_lag"), "b": CaseVerdict(outcome="no_gap")}
    path = tmp_path / "verdicts.json"
    file = VerdictFile(
        format="smad-verdicts-1",
        bank=bank,
        key_sha256=file_digest(key_path),
        verdicts=verdicts,
        tool={"version": "1.2.3"},
    )
    write_verdicts(path, file)
    # As a bank of check-ups tells them.
    body = json.loads(path.read_text())
    for verdict in body["verdicts"].values():
        verdict["baselines"] = {"match": {"outcome": "effect", "names": ["rtd_lag"]}}
    path.write_text(json.dumps(body))
    return path, key_path


def _read(verdicts: Path, key: Path) -> tuple[VerdictFile, Published]:
    file = read_verdicts(verdicts)
    pairs = matched(file, *read_key(key))
    return file, published(pairs, "dev", told_beside(verdicts, [], None, []))


def _fit(*names: str, chi2: float, objective: float, held_out: float) -> FittedRecord:
    parameters = 20 + 2 * len(names)
    return FittedRecord(list(names), parameters, 5000, objective, chi2, held_out, 1.0, -objective)


FITTED = [
    _fit(chi2=5000.0, objective=2500.0, held_out=1.5),
    _fit("rtd_lag", chi2=4900.0, objective=2440.0, held_out=1.3),
    _fit("rtd_lag", "minor_loop", chi2=4890.0, objective=2436.0, held_out=1.2),
]


def test_each_baseline_follows_its_rule() -> None:
    said = baselines(FITTED, ["rtd_lag", "minor_loop"], "case-001")
    assert said["smallest_rmse"].names == ["rtd_lag", "minor_loop"]
    assert said["bic_only"].names == ["rtd_lag"]
    assert said["chi2_only"].names == ["rtd_lag", "minor_loop"]


def test_a_baseline_that_keeps_the_refit_says_no_gap() -> None:
    idle = [FITTED[0], _fit("rtd_lag", chi2=4997.0, objective=2499.0, held_out=1.6)]
    said = baselines(idle, ["rtd_lag"], "case-001")
    assert {said[n].outcome for n in ("smallest_rmse", "bic_only", "chi2_only")} == {"no_gap"}


def test_the_random_baseline_is_the_same_for_a_case_and_varies_over_cases() -> None:
    library = [e.name for e in SmaPlant().effects]
    said = [baselines([], library, f"case-{i:03d}")["random"] for i in range(200)]
    assert said == [baselines([], library, f"case-{i:03d}")["random"] for i in range(200)]
    assert {"effect", "no_gap", "unknown"} == {s.outcome for s in said}
    assert len({n for s in said for n in s.names}) > 25
