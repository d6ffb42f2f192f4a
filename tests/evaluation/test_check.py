"""A small bank through the whole check: made, diagnosed, interrupted, scored, and its oracle."""

from __future__ import annotations

import json
from pathlib import Path

import msgspec
import pytest
from smad.gap.settings import Settings

from evaluation.bank import files
from evaluation.bank.cases import Case
from evaluation.bank.making import Style, make
from evaluation.plant.effects import BY_NAME, Active, names
from smad.cli import execute
from smad.diagnosis.bank.bank import open_bank
from smad.diagnosis.bank.case import How
from smad.diagnosis.bank.names import ALIASES, CAUSES, canonical, subsystem_of
from smad.diagnosis.bank.running import Order, Progress, check
from smad.diagnosis.bank.score import Scores
from smad.diagnosis.bank.verdicts import (
    read_verdict_file,
    read_verdicts,
    write_verdicts,
)
from smad.diagnosis.spring_pair import SmaPlant
from tests.evaluation.quick import quicken

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


def test_the_product_and_the_bank_name_the_listed_causes_alike() -> None:
    assert set(CAUSES) == set(names("known"))
    assert {n: subsystem_of(n) for n in CAUSES} == {n: BY_NAME[n].subsystem for n in CAUSES}


def test_every_listed_cause_has_an_entry_in_the_library() -> None:
    library = [e.name for e in SmaPlant().effects]
    assert set(CAUSES) <= {canonical(entry) for entry in library}
    uneven = {"cold_ends", "temperature_spread", "cooling_front"}
    assert {e for e in library if canonical(e) == "cold_ends"} == uneven
    assert ALIASES["water_drainage"] == "water_drain"


def test_a_key_in_full_reads_as_the_scorer_wants_it(bank: Path) -> None:
    from smad.diagnosis.bank.key import read_key

    key, sha256 = read_key(bank.with_name("small-key") / "KEY.json")
    assert sha256 == open_bank(bank).manifest.key_sha256
    assert key.cases["case-001"].names == {"rtd_offset"}
    assert key.cases["case-001"].effects[0].quantity is not None
    assert key.cases["case-002"].right_answer == {"none"}
    assert msgspec.to_builtins(key.cases["case-002"].effects) == []
