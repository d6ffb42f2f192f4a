"""Scores: what was said against what is true, goals beside, sealed keys behind their hash."""

import datetime
import hashlib
import json
from pathlib import Path
from typing import Any

import pytest

from evaluation.command import main
from evaluation.errors import KeyMismatchError, WithheldError
from evaluation.results.page import markdown_table, rendered
from evaluation.results.record import FOLDER, all_results
from evaluation.score.answers import digest, read_pairs
from evaluation.score.goals import Row
from evaluation.score.intervals import wilson
from evaluation.score.openings import Ledger, refuse_sealed
from evaluation.score.scores import (
    calibration,
    calibration_by_chance,
    calibration_of_equals,
    scored,
    tables,
)
from evaluation.score.scoring import run
from smad.report.page import Table

OPENED = "92fdaa9a0888e0aa56ef60510ac31ac334fc10a976fe06a9c2c0a652d7d54640"
LINES = 50
"""Of the log of openings when it was last looked at."""

LAG: dict[str, Any] = {"name": "rtd_lag", "known": True, "places": ["reading_rtd"]}
PICKUP = LAG | {"name": "rtd_current_pickup", "known": False}
DRAG: dict[str, Any] = {
    "name": "viscous_drag", "known": True, "places": ["force_cell_on_x", "force_cell_on_y"],
}  # fmt: skip


def true(kind: str, *effects: Any, floors: float = 3.0, **more: Any) -> dict[str, Any]:
    return {"kind": kind, "effects": list(effects), "gap_worst": floors, **more}


def cause(
    code: str, name: str = "", p: float = 0.9, reported: tuple[str, ...] = (), **more: Any
) -> dict[str, Any]:
    """A cause at a place; `p` is the probability of its name over all rivals."""
    return {
        "kind": "effect" if name else "law",
        "place": code,
        "name": name,
        "probability": 0.9,
        "names": {name: 1.0} if name else {},
        "outside": 1.0 - p if name else 1.0,
        "credible_places": [code, *reported],
        **more,
    }


def said(*causes: Any, outcome: str = "causes", **more: Any) -> dict[str, Any]:
    return {"outcome": outcome, "causes": list(causes), "seconds": 2.0, **more}


QUIET = said(outcome="quiet")


def written(
    folder: Path, key: dict[str, Any], answers: dict[str, Any], bank: str = "x"
) -> tuple[Path, Path]:
    """A file of answers and a key that belong together."""
    path = folder / "KEY.json"
    path.write_text(json.dumps({"format": "smad-key-1", "bank": bank, "cases": key}))
    reported = {"format": "smad-verdicts-3", "bank": bank, "key_sha256": digest(path)}
    (folder / "answers.json").write_text(json.dumps(reported | {"verdicts": answers}))
    return folder / "answers.json", path


def rows(folder: Path, cases: dict[str, tuple[Any, Any]]) -> dict[str, Row]:
    files = written(
        folder, {c: t for c, (t, _) in cases.items()}, {c: s for c, (_, s) in cases.items()}
    )
    (found,) = scored(read_pairs(*files)[1]).values()
    return {r.name: r for r in found}


def test_places_and_names_are_counted_against_the_truth(tmp_path: Path) -> None:
    found = rows(
        tmp_path,
        {
            "a": (true("single", LAG), said(cause("reading_rtd", "rtd_lag"))),
            "b": (
                true("single", LAG),
                said(cause("resistance", "phase_resistivity", reported=("reading_rtd",))),
            ),
            "c": (true("single", LAG), said(cause("reading_rtd", "rtd_lag", p=0.4))),
            "d": (true("unknown", PICKUP), said(cause("reading_rtd", "rtd_lag", p=0.4))),
            "e": (true("unknown", PICKUP, floors=0.5), QUIET),
            "f": (true("none"), QUIET),
            "g": (true("parameters"), said(outcome="parameters")),
        },
    )
    value = {name: (row.value, row.count) for name, row in found.items()}
    assert value["place right first, listed"] == (pytest.approx(2 / 3), 3)
    assert value["place right first, unlisted"] == (1.0, 1)
    assert value["reported places hold the truth, listed"] == (1.0, 3)
    assert found["reported places, mean number"].value == pytest.approx(5 / 4)
    assert value["right name first, of noticed listed"] == (pytest.approx(2 / 3), 3)
    assert value["right name reported, of noticed listed"] == (pytest.approx(1 / 3), 3)
    assert value["right name, of names reported"] == (0.5, 2)
    assert value["unlisted reported by name"] == (0.0, 1)
    assert value["noticed near 1 floor"] == (0.0, 1)
    assert value["noticed near 3 floors"] == (1.0, 4)
    assert value["quiet benches called changed"] == (0.0, 1)
    assert value["parameters given a cause"] == (0.0, 1)
    assert value["processor time, longest"] == (2.0, 7)
    low, high = found["place right first, listed"].low, found["place right first, listed"].high
    assert (low, high) == wilson(2, 3)


def test_a_change_that_nothing_explains_is_noticed(tmp_path: Path) -> None:
    found = rows(tmp_path, {"a": (true("single", LAG), said(outcome="unexplained"))})
    assert found["noticed near 3 floors"].value == 1.0
    assert found["place right first, listed"].value == 0.0


def test_a_quiet_bench_with_other_parameters_is_called_changed(tmp_path: Path) -> None:
    found = rows(tmp_path, {"a": (true("none"), said(outcome="parameters"))})
    assert found["quiet benches called changed"].value == 1.0


def test_the_gap_that_goes_is_a_share_of_what_is_above_the_floor(tmp_path: Path) -> None:
    wholes = (
        {"raw": 9.0, "parameters": 3.0, "causes": [2.0, 1.0]},
        {"raw": 9.0, "parameters": 3.0, "causes": [5.0**0.5]},
        {"raw": 2.0, "parameters": 1.05, "causes": [1.0]},
    )
    cases = {
        f"{i}": (true("single", LAG), said(cause("reading_rtd"), whole=whole))
        for i, whole in enumerate(wholes)
    }
    assert rows(tmp_path, cases)["gap gone, listed"].value == pytest.approx(0.75)


def test_a_cause_that_leaves_more_than_parameters_alone_is_counted(tmp_path: Path) -> None:
    worse = {"raw": 9.0, "parameters": 3.0, "causes": [3.1]}
    better = worse | {"causes": [2.9]}
    cases = {
        f"{i}": (true("single", LAG), said(cause("reading_rtd"), whole=whole))
        for i, whole in enumerate((worse, better))
    }
    assert rows(tmp_path, cases)["held-out gap above that of parameters alone"].value == 0.5


def test_a_pair_wants_both_places_and_both_names(tmp_path: Path) -> None:
    both = said(cause("force_cell_on_y", "viscous_drag"), cause("film"), cause("reading_rtd"))
    names = said(cause("reading_rtd", "rtd_lag"), cause("force_cell_on_x", "viscous_drag"))
    found = rows(
        tmp_path,
        {"a": (true("pair", LAG, DRAG), both), "b": (true("pair", LAG, DRAG), names),
         "c": (true("pair", LAG, DRAG), said(cause("film")))},
    )  # fmt: skip
    assert found["pairs: both places among the first three"].value == pytest.approx(2 / 3)
    assert found["pairs: both names reported"].value == pytest.approx(1 / 3)


def test_one_cause_at_a_place_that_both_effects_share_is_not_both_places(tmp_path: Path) -> None:
    other = DRAG | {"name": "force_creep", "places": ["force_cell_on_y", "reading_force"]}
    one = said(cause("force_cell_on_y", "viscous_drag"), cause("film"))
    two = said(cause("force_cell_on_y"), cause("force_cell_on_x"))
    found = rows(
        tmp_path,
        {"a": (true("pair", DRAG, other), one), "b": (true("pair", DRAG, other), two)},
    )
    assert found["pairs: both places among the first three"].value == 0.5


def test_of_differs_the_added_effect_and_the_plants_own_are_looked_for(tmp_path: Path) -> None:
    own = [{"places": ["film"]}, {"places": ["heat_into_water", "reading_rtd"]}]
    whole = {"parameters": 30.0, "causes": [20.0, 12.0, 10.0]}
    reported = said(
        cause("film"), cause("resistance"), cause("reading_rtd", "rtd_lag"), whole=whole
    )
    found = rows(
        tmp_path,
        {
            "a": (true("differs", LAG, question="differs", own=own), reported),
            "b": (true("differs", question="differs", own=own), said(cause("film"))),
        },
    )
    value = {name: (row.value, row.count) for name, row in found.items()}
    assert value["added effect's place among the first three"] == (1.0, 1)
    assert value["added effect's entry named first at its place"] == (1.0, 1)
    assert value["own differences among the first four places"] == (0.75, 2)
    assert value["causes reported where something differs"] == (0.75, 4)
    assert value["floors left by parameters alone, median"] == (30.0, 1)
    assert value["floors left with what is reported, median"] == (10.0, 1)


def test_without_the_right_entry_its_place_may_be_reported_but_no_name(
    tmp_path: Path,
) -> None:
    less = {"rtd_lag": {"outcome": "causes", "places": ["reading_rtd"], "name": "channel_delay"}}
    found = rows(tmp_path, {"a": (true("single", LAG), said(left_out=less))})
    assert found["left out: its place still reported"].value == 1.0
    assert found["left out: reported by name all the same"].value == 1.0


def test_probabilities_of_places_are_compared_with_how_often_they_are_right(tmp_path: Path) -> None:
    cases = {
        f"{i}": (true("single", LAG), said(cause(code)))
        for i, code in enumerate(("reading_rtd", "film"))
    }
    assert rows(tmp_path, cases)["error of the probabilities of places"].value == pytest.approx(0.4)


def test_what_right_probabilities_show_by_chance_grows_with_fewer_cases() -> None:
    few, many = ([(p, True) for p in (0.3, 0.5, 0.7, 0.9)] * n for n in (2, 200))
    assert 0.1 < calibration_by_chance(few) < 0.4
    assert 0.0 < calibration_by_chance(many) < 0.03
    assert calibration_by_chance([(1.0, True)] * 9) == 0.0


def test_questions_have_goals_of_their_own_and_tables_beside(tmp_path: Path) -> None:
    least = [
        {"kind": "effect", "name": "rtd_offset", "scores": [-1.0, -2.0]},
        {"kind": "effect", "name": "rtd_lag", "scores": [-2.0, -2.0]},
        {"kind": "law", "name": "reading_rtd", "scores": [-0.5, -0.5]},
    ]
    key = {"a": true("single", LAG), "b": true("single", LAG, question="changed")}
    answers = {
        "a": said(cause("reading_rtd", "rtd_lag"), first_step=least),
        "b": said(cause("film")),
    }
    found = tables(read_pairs(*written(tmp_path, key, answers))[1])
    goals = {h: {r[0]: r[3:] for r in t.rows} for h, t in found.items() if h.startswith("Scores")}
    assert goals["Scores, check-up"]["noticed near 3 floors"] == ("≥ 0.97", "yes")
    assert goals["Scores, changed"]["noticed near 3 floors"] == ("≥ 0.75", "yes")
    assert goals["Scores, changed"]["pairs: both names reported"] == ("", "")
    rules = found["By likelihood alone: right name first, of noticed listed"].rows
    assert [r[1][:4] for r in rules] == ["1.00", "0.00"]
    assert [r[0] for r in found["Wrong or missed"].rows] == ["b"]
    assert found["Over strength"].rows


def test_answers_to_another_bank_or_to_strange_cases_are_refused(tmp_path: Path) -> None:
    answers, key = written(tmp_path, {"a": true("none")}, {"b": QUIET})
    with pytest.raises(KeyMismatchError, match="the key has no b"):
        read_pairs(answers, key)
    key.write_text(key.read_text() + "\n")
    with pytest.raises(KeyMismatchError, match="key of their own bank"):
        read_pairs(answers, key)


def test_processor_time_is_that_of_the_case_where_it_was_measured(tmp_path: Path) -> None:
    answers, key = written(tmp_path, {"a": true("none")}, {"a": QUIET})
    reported = json.loads(answers.read_text()) | {"tool": {"name": "smad", "cpu_s": {"a": 1.25}}}
    answers.write_text(json.dumps(reported))
    assert read_pairs(answers, key)[1][0].said.seconds == 1.25


def test_a_case_without_an_answer_is_refused_or_left_out(tmp_path: Path) -> None:
    files = written(tmp_path, {"a": true("none"), "b": true("none")}, {"a": QUIET})
    assert [p.said.outcome for p in read_pairs(*files)[1]] == ["quiet", "refused"]
    assert len(read_pairs(*files, answered_only=True)[1]) == 1


def test_a_sealed_key_that_was_not_entered_is_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    answers, key = written(tmp_path, {"a": true("none")}, {"a": QUIET}, bank="sealed")
    before = Ledger.of().record.read_text()
    with pytest.raises(SystemExit):
        main(["score", str(answers), str(key)])
    shown = capsys.readouterr()
    assert "commit its hash" in shown.err
    assert "quiet benches" not in shown.out
    assert Ledger.of().record.read_text() == before


def test_a_sealed_key_is_opened_once_and_that_is_logged(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    answers, key = written(tmp_path, {"a": true("none")}, {"a": QUIET}, bank="sealed")
    tool = {"name": "smad", "source_sha256": "ef" * 32}
    answers.write_text(json.dumps(json.loads(answers.read_text()) | {"tool": tool}))
    ledger = Ledger.of(tmp_path)
    ledger.seal(digest(key), "KEY.json")
    monkeypatch.setattr(Ledger, "of", lambda: ledger)
    run(answers, key)
    assert "quiet benches called changed" in capsys.readouterr().out
    line = json.loads(ledger.record.read_text())
    assert line["scores"]["check-up: quiet benches called changed"] == 0.0
    assert line["verdicts_sha256"] == digest(answers)
    assert line["source_sha256"] == "ef" * 32
    with pytest.raises(KeyMismatchError, match="opened before"):
        run(answers, key)


def test_a_folder_without_a_key_is_refused_in_a_sentence(tmp_path: Path) -> None:
    with pytest.raises(WithheldError, match=r"KEY\.json cannot be read"):
        refuse_sealed(tmp_path / "KEY.json")


def test_an_opening_is_a_line_of_the_page(tmp_path: Path) -> None:
    ledger = Ledger.of(tmp_path)
    when = datetime.datetime(2030, 5, 1, 12, tzinfo=datetime.UTC)
    found = {"check-up": [Row("noticed near 3 floors", 0.987, 0.9, 1.0, 30)]}
    ledger.enter("ab" * 32, "cd" * 32, found, cases=30, commit="abc", source_sha256="", now=when)
    assert "| 2030-05-01 12:00 | abc | abababababab | 30 | – | 0.99 |" in rendered(
        [], ledger.record
    )


def test_the_page_shows_every_score_and_goal_of_the_sealed_banks() -> None:
    page = rendered(all_results())
    for result in (r for r in all_results() if "sealed" in r.title):
        _, first = next(iter(result.tables.items()))
        assert all(f"| {' | '.join(row)} |" in page for row in first.rows)


def test_scores_are_kept_as_a_result(tmp_path: Path) -> None:
    files = written(tmp_path, {"a": true("none")}, {"a": QUIET})
    run(*files, out=tmp_path / "kept.json", title="T", answered_only=True)
    (tmp_path / "KEY.json").unlink()
    (tmp_path / "answers.json").unlink()
    (result,) = all_results(tmp_path)
    assert result.title == "T"
    assert result.command == "python -m evaluation score --answered-only"
    assert next(iter(result.tables)) == "Scores, check-up"


def test_scores_are_kept_although_the_reader_of_the_output_leaves(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def gone(table: object) -> None:
        raise BrokenPipeError

    monkeypatch.setattr("evaluation.score.scoring.print_table", gone)
    files = written(tmp_path, {"a": true("none")}, {"a": QUIET})
    with pytest.raises(BrokenPipeError):
        run(*files, out=tmp_path / "kept.json", title="T")
    assert json.loads((tmp_path / "kept.json").read_text())["title"] == "T"


def test_no_opening_of_a_sealed_bank_is_taken_back_or_changed() -> None:
    lines = (FOLDER / "openings.jsonl").read_bytes().splitlines(keepends=True)
    assert hashlib.sha256(b"".join(lines[:LINES])).hexdigest() == OPENED


def test_names_said_at_even_odds_are_right_where_as_many_effects_are_listed_as_not() -> None:
    listed, unlisted = [(0.5, True)] * 4, [(0.5, False)]
    assert calibration([*listed, *unlisted]) == pytest.approx(0.3)
    assert calibration_of_equals([listed, unlisted]) == pytest.approx(0.0)


def test_a_table_in_a_document_aligns_its_numbers_to_the_right() -> None:
    table = Table(("name", "value"), (("a", "1.0"),), numeric=frozenset({1}))
    assert markdown_table(table).splitlines() == ["| name | value |", "|---|---:|", "| a | 1.0 |"]
