"""Scores of where, law and name, of cases whose answers are known."""

import json
from pathlib import Path
from typing import Any

import pytest
from evaluation.score.where import PLACES_OF, main, near_places, summary


def case(kind: str, *effects: str, place: str = "", name: str = "", takes: float = 0.0) -> Any:
    told = {
        "place": place, "side": "both", "share": 0.5, "near": [], "terms": [],
        "in_simulator": True, "nearest": name, "takes": takes,
    }  # fmt: skip
    return {
        "case": "case-001", "bench": "bench-1", "kind": kind, "floors": 3.0, "seconds": 4.0,
        "effects": [[e, kind == "single", 1.0] for e in effects],
        "outcome": "unknown" if place else "quiet", "told": [told] if place else [],
        "whole": [3.0, 2.0, 1.0],
        "ranked": [[place, "both", 0.5, []], ["film", "x", 0.45, []], ["film", "y", 0.1, []]],
    }  # fmt: skip


def row(lines: list[str], title: str) -> str:
    return next(line for line in lines if line.startswith(title))


def test_places_and_names_are_counted_against_the_truth() -> None:
    cases = [
        case("single", "rtd_lag", place="reading_rtd", name="rtd_lag", takes=1.0),
        case("single", "rtd_lag", place="resistance", name="phase_resistivity", takes=1.0),
        case("unknown", "rtd_current_pickup", place="reading_rtd", name="rtd_lag", takes=0.1),
        case("none"),
    ]
    lines = summary(cases, 0.8, 0.9)
    assert "1 of 2 " in row(lines, "place right first, listed")
    assert "1 of 1 " in row(lines, "place right first, unlisted")
    assert "1 of 2 " in row(lines, "right name, of names given")
    assert "0 of 1 " in row(lines, "unlisted given a name")
    assert "0 of 1 " in row(lines, "quiet benches called changed")
    assert "takes 1.00" in row(lines, "listed:")


def test_a_place_is_near_by_what_it_takes_alone() -> None:
    found = case("single", "rtd_lag", place="reading_rtd")
    assert near_places(found, 0.8) == ["reading_rtd", "film"]
    assert near_places(found, 0.95) == ["reading_rtd"]


def test_kept_cases_are_scored_again_with_other_constants(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    kept = tmp_path / "kept.json"
    weak = case("single", "rtd_lag", place="reading_rtd", name="rtd_lag", takes=0.6)
    kept.write_text(json.dumps([weak]))
    main(["--from", str(kept)])
    said = capsys.readouterr().out.split("\n\n")
    names = {part.split("\n")[0]: row(part.split("\n"), "right name, of names") for part in said}
    assert "1 of 1 " in names["near 0.8, name_share 0.5"]
    assert "0 of 0 " in names["near 0.8, name_share 0.7"]


def test_every_effect_of_the_plant_that_a_bank_may_have_has_a_place() -> None:
    from evaluation.plant.effects import EFFECTS

    assert {e.name for e in EFFECTS if e.kind in ("known", "dev")} <= set(PLACES_OF)
