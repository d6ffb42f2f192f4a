"""What is published of a bank, on made-up verdicts whose scores are known by hand."""

import datetime
import json
from pathlib import Path
from typing import Any

import msgspec
import pytest

from smad.gap.check.errors import CheckError, KeyMismatchError
from smad.gap.check.key import FORMAT, file_digest, read_key
from smad.gap.check.score import Mistake, matched
from smad.gap.check.verdicts import (
    CaseVerdict,
    HeldOut,
    NextExperiment,
    Short,
    VerdictFile,
    read_verdicts,
    write_verdicts,
)
from smad.gap.records import FittedRecord
from smad.gap.sma import SmaPlant
from smad.report.page import render
from tests.smad.gap.test_check_score import LAG, SHA, _entry, _key, _named
from tests.withheld import score_page
from tests.withheld.baselines import baselines, told_beside
from tests.withheld.command import main
from tests.withheld.goals import Scored
from tests.withheld.openings import Ledger, checkout
from tests.withheld.places import TABLES, begin, end, into_document
from tests.withheld.scores import Published, published


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


def test_an_experiment_is_asked_to_resolve_only_where_a_cause_of_the_list_is_at_work() -> None:
    kinds = {"a": _entry("single", LAG), "b": _entry("unknown", ("x", "sensors"))}
    key = kinds | {"c": _entry("differs"), "d": _entry("none")}
    asked = CaseVerdict(outcome="unknown", next_experiment=NextExperiment("rest", [], []))
    resolved = msgspec.structs.replace(
        asked, next_experiment=NextExperiment("rest", ["rtd_lag"], ["rtd_lag"])
    )
    row = _rows(key, dict.fromkeys("bcd", asked) | {"a": resolved})[
        "recommended experiment resolves"
    ]
    assert (row.value, row.count) == (1.0, 1)


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
    assert "What the model is trusted to" in render(score_page.page(found, []))


def test_the_command_scores_and_writes_json_page_and_readme(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    verdicts, key = _scored(tmp_path, "dev")
    out, html, readme = (tmp_path / n for n in ("scores.json", "scores.html", "README.md"))
    readme.write_text(f"before\n{begin('scores')}\nold\n{end('scores')}\nafter\n")
    options = ["--json", str(out), "--html", str(html), "--readme", str(readme)]
    main(["score", str(verdicts), str(key), *options])
    assert "right name first" in capsys.readouterr().out
    assert msgspec.json.decode(out.read_bytes(), type=Published) == _read(verdicts, key)[1]
    text = html.read_text()
    assert text.count("<svg") == 3
    assert "1.2.3" in text
    assert 'src="http' not in text
    assert "| right name first" in readme.read_text()
    assert "old" not in readme.read_text()
    assert readme.read_text().startswith("before\n")
    assert readme.read_text().endswith("after\n")


def test_a_readme_without_markers_is_refused(tmp_path: Path) -> None:
    _, found = _read(*_scored(tmp_path, "dev"))
    (tmp_path / "README.md").write_text("nothing")
    with pytest.raises(CheckError, match="two markers"):
        into_document(tmp_path / "README.md", found)


def test_a_document_whose_markers_stand_the_wrong_way_round_is_refused_and_kept(
    tmp_path: Path,
) -> None:
    _, found = _read(*_scored(tmp_path, "dev"))
    document = tmp_path / "README.md"
    text = f"{end('scores')}\n{begin('scores')}\nwritten by hand\n"
    document.write_text(text)
    with pytest.raises(CheckError, match="two markers"):
        into_document(document, found)
    assert document.read_text() == text


def test_a_document_gets_every_table_that_it_has_a_place_for(tmp_path: Path) -> None:
    verdicts, key = _scored(tmp_path, "dev")
    _, found = _read(verdicts, key)
    documents = [tmp_path / "README.md", tmp_path / "results.md"]
    documents[0].write_text(f"{begin('scores')}\n{end('scores')}\n")
    documents[1].write_text("".join(f"## {n}\n{begin(n)}\nold\n{end(n)}\n" for n in TABLES))
    options = [x for d in documents for x in ("--readme", str(d))]
    for _ in range(2):  # a second time the same comes out
        main(["score", str(verdicts), str(key), *options])
        short, whole = (d.read_text() for d in documents)
        assert "| truth |" not in short
        assert "old" not in whole
        assert "| truth | right answer |" in whole
        for truth, said in found.confusion.items():
            (line,) = [x for x in whole.splitlines() if x.startswith(f"| {truth} |")]
            assert all(f"{name} ({n})" in line for name, n in said.items())
    wrong = Mistake("case-007", "single", ["rtd_lag"], 3.0, ["rtd_offset"], "effect", 0.9)
    into_document(documents[1], msgspec.structs.replace(found, mistakes=[wrong]))
    assert "| case-007 | single | rtd_lag | 3.0 | effect | rtd_offset | 0.90 |" in (
        documents[1].read_text()
    )


def test_a_sealed_key_that_was_not_committed_is_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    verdicts, key = _scored(tmp_path, "sealed")
    record = Ledger.of(checkout()).record
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


def test_every_opening_is_entered_with_date_commit_and_scores(tmp_path: Path) -> None:
    file, found = _read(*_scored(tmp_path, "dev"))
    (tmp_path / "docs").mkdir()
    ledger = Ledger.of(tmp_path)
    when = datetime.datetime(2030, 5, 1, 12, 0, tzinfo=datetime.UTC)
    for _ in range(2):
        ledger.enter(file.key_sha256, "c" * 64, found, commit="abc", now=when)
    assert ledger.page.read_text().count("2030-05-01 12:00") == 2
    line = json.loads(ledger.record.read_text().splitlines()[0])
    assert line["scores"]["right name first, of the detected"] == 1.0
    assert line["commit"] == "abc"


def test_the_page_of_openings_is_made_from_its_record() -> None:
    ledger = Ledger.of(checkout())
    assert ledger.page.read_text() == ledger.rendered()


def test_shrink_is_told_beside_that_of_the_oracles() -> None:
    key = {c: _entry("single", LAG) for c in "ab"}
    verdicts = {
        "a": _named(
            "rtd_lag",
            shrink=0.8,
            shrink_best_entry=0.8,
            next_experiment=NextExperiment("two_ramps", ["rtd_lag"], ["rtd_lag"]),
        ),
        "b": _named(
            "rtd_lag",
            shrink=0.4,
            shrink_best_entry=0.8,
            next_experiment=NextExperiment("two_ramps", ["rtd_lag"], ["rtd_offset"]),
        ),
    }
    rows = _rows(key, verdicts)
    assert rows["median held-out shrink, tool ÷ O2"].value == pytest.approx(0.75)
    assert rows["median held-out shrink, tool ÷ O1"].value == pytest.approx(0.6 / 0.9)
    assert rows["recommended experiment resolves"].value == 0.5


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
