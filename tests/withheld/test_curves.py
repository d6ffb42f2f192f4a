"""Scores of check-ups: what counts as detected and as right, and where the tables go."""

import json
from pathlib import Path
from typing import Any

import pytest

from smad.gap.check.verdicts import read_verdicts
from smad.gap.paired.verdict import Likely, Share, Verdict
from smad.gap.sma import SmaPlant
from tests.withheld.calibrating import truth_of
from tests.withheld.check_up import as_told, single_entries
from tests.withheld.curves import beside, put_into, scored, tables
from tests.withheld.errors import BankError


def entry(kind: str, strength: float, *names: str) -> dict[str, Any]:
    return {"kind": kind, "gap_worst": strength, "effects": [{"name": n} for n in names]}


def verdict(
    outcome: str, *causes: tuple[str, float], group: tuple[str, ...] = ()
) -> dict[str, Any]:
    told = [{"names": n.split("+"), "probability": p} for n, p in causes]
    return {"outcome": outcome, "causes": told, "group": list(group), "shrink": 0.9, "seconds": 2.0}


CASES = [
    (entry("single", 5.0, "rtd_lag"), verdict("effect", ("rtd_lag", 0.9), ("driver_lag", 0.1))),
    (entry("single", 5.0, "rtd_lag"), verdict("ambiguous", ("driver_lag", 0.5), ("rtd_lag", 0.4),
                                              group=("driver_lag", "rtd_lag"))),
    (entry("single", 0.5, "rtd_lag"), verdict("no_gap")),
    (entry("none", 0.0), verdict("no_gap")),
    (entry("none", 0.0), verdict("effect", ("rtd_lag", 1.0))),
    (entry("unknown", 4.0, "stiction"), verdict("unknown", ("unknown", 0.8))),
    (entry("pair", 8.0, "rtd_lag", "force_gain"), verdict("effect", ("rtd_lag+force_gain", 0.7))),
    (entry("pair", 8.0, "rtd_lag", "force_gain"), verdict("effect", ("rtd_lag", 0.7))),
]  # fmt: skip


@pytest.fixture
def bank(tmp_path: Path) -> tuple[Path, Path]:
    """A verdict file and the folder of its key."""
    names = [f"case-{k}" for k in range(len(CASES))]
    told = {"bank": "b", "verdicts": {n: v for n, (_, v) in zip(names, CASES, strict=True)}}
    key = {"bank": "b", "cases": {n: e for n, (e, _) in zip(names, CASES, strict=True)}}
    (tmp_path / "verdicts.json").write_text(json.dumps(told))
    (tmp_path / "KEY.json").write_text(json.dumps(key))
    return tmp_path / "verdicts.json", tmp_path


def test_the_tables_count_what_was_detected_and_named(bank: tuple[Path, Path]) -> None:
    text = tables(scored(*bank))
    strong = next(line for line in text.splitlines() if line.startswith("| 3 to 10"))
    shown = [cell.strip().split(" ")[0] for cell in strong.split("|")[2:8]]
    assert shown == ["2", "1.00", "0.50", "0.50", "1.00", "0.65"]
    assert "| nothing | false alarms | 2 | 0.50" in text
    assert "| the same, detected | said to be unknown | 1 | 1.00" in text
    assert "| the same, detected | all named, and nothing else | 2 | 0.50" in text
    assert "| the same, detected | at least one named, none wrong | 2 | 1.00" in text


def test_a_verdict_of_a_check_up_is_in_the_form_that_is_scored(tmp_path: Path) -> None:
    # A set stands behind its first member, whose probability is less than that of "unknown".
    weights = {"rtd_lag": 0.3, "rtd_lag+slip": 0.1, "unknown": 0.4, "friction": 0.2 / 3.0}
    rest = 1.0 - sum(weights.values())
    likely = [Likely(n.split("+"), p) for n, p in (weights | {"parameters": rest}).items()]
    nothing = Share("all", "floors", 1.0, 1.0, 1.0, 1.0)
    found = Verdict(
        outcome="cause", headline="", likely=likely, group=[], left=0.2, ratio=9.0,
        worst_run="run-1", budget=[], whole=nothing, notes=[], repeats=2,
    )  # fmt: skip
    told = {
        "format": "smad-verdicts-1", "bank": "b", "key_sha256": "",
        "verdicts": {"case-1": as_told(found, 1.0)},
    }  # fmt: skip
    (tmp_path / "verdicts.json").write_text(json.dumps(told))
    verdict = read_verdicts(tmp_path / "verdicts.json").verdicts["case-1"]
    assert [h.names for h in verdict.causes[:2]] == [["unknown"], ["rtd_lag"]]


def test_a_key_of_another_bank_is_refused(bank: tuple[Path, Path]) -> None:
    verdicts, key = bank
    (key / "KEY.json").write_text(json.dumps({"bank": "other", "cases": {}}))
    with pytest.raises(BankError, match="of bank b"):
        scored(verdicts, key)


def test_tables_go_between_the_marks_of_a_page_and_nowhere_else(tmp_path: Path) -> None:
    page = tmp_path / "page.md"
    page.write_text("before\n<!-- scores -->\nold\n<!-- end -->\nafter\n")
    put_into(page, "new\n")
    assert page.read_text() == "before\n<!-- scores -->\nnew\n<!-- end -->\nafter\n"
    page.write_text("no marks")
    with pytest.raises(BankError, match="mark one with"):
        put_into(page, "new\n")


def test_every_entry_of_the_library_for_a_cause_is_its_right_name(tmp_path: Path) -> None:
    one = {"kind": "single", "effects": [{"name": "valve_leak"}]}
    truth = truth_of(one)
    assert truth.probability([Likely(["thermal_crosstalk"], 0.4), Likely(["valve_leak"], 0.5)]) == (
        pytest.approx(0.9)
    )
    assert truth.probability([Likely(["valve_leak", "rtd_lag"], 1.0)]) == 0.0
    (tmp_path / "KEY.json").write_text(json.dumps({"cases": {"case-0": one}}))
    cause, names = single_entries(tmp_path, SmaPlant())["case-0"]
    assert (cause, set(names)) == ("valve_leak", {"thermal_crosstalk", "valve_leak"})


def test_an_effect_that_the_library_lacks_is_unknown() -> None:
    assert truth_of({"kind": "unknown", "effects": [{"name": "x"}]}).kind == "unknown"
    assert truth_of({"kind": "none", "effects": []}).kind == "quiet"


def test_simpler_rules_and_left_out_entries_are_told_where_they_were_asked(
    bank: tuple[Path, Path],
) -> None:
    verdicts, key = bank
    assert "random" not in tables(scored(verdicts, key))
    told = json.loads(verdicts.read_text())
    for v in told["verdicts"].values():
        v["baselines"] = {
            rule: {"outcome": "effect", "names": ["rtd_lag"]} for rule in ("match", "bic", "random")
        }
    told["verdicts"]["case-0"]["left_out"] = {"rtd_lag": {"outcome": "unknown", "names": []}}
    told["verdicts"]["case-1"]["left_out"] = {"rtd_lag": {"outcome": "effect", "names": ["x"]}}
    verdicts.write_text(json.dumps(told))
    text = tables(scored(verdicts, key))
    assert "| random | 1.00" in text
    assert "unknown 1; another name 1" in text


def test_verdict_files_of_one_bank_stand_beside_each_other(bank: tuple[Path, Path]) -> None:
    verdicts, key = bank
    told = json.loads(verdicts.read_text())
    told["floors"] = {"bench-1": {"displacement_mm": 0.02, "rtd_x_degC": 0.3}}
    verdicts.write_text(json.dumps(told))
    head, _, *rows = beside({"1": verdicts, "2": verdicts}, key, "repeats").splitlines()
    assert head.startswith("| repeats | floor")
    assert [row.split("|")[1].strip() for row in rows] == ["1", "2"]
    assert rows[0].split("|")[2].strip() == "0.02"
