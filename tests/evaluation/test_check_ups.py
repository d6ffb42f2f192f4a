"""The protocol check-up: what is played, and what a bank of it holds."""

import json
from pathlib import Path

import numpy as np
import pytest

from evaluation.bank import any_inputs
from evaluation.bank.check_ups import CheckUps, make, read_programme
from evaluation.bank.files import read_run
from evaluation.command import main
from evaluation.errors import BankError
from evaluation.plant.effects import names
from evaluation.run.running import run
from evaluation.score.openings import Ledger

PROGRAMME = """format = "smad-programme-1"
name = "tiny"
title = "one run"

[[runs]]
name = "run-1"
title = "a pulse"
duration_s = 12.0
quick = true
"""


def _programme(folder: Path) -> Path:
    folder.mkdir()
    (folder / "programme.toml").write_text(PROGRAMME)
    (folder / "run-1.csv").write_text("t_s,i_x_A,i_y_A,duty_x,duty_y\n0,0,0,0,0\n4,2.5,0,0,0.5\n")
    return folder


def test_a_row_holds_until_the_next_and_the_last_to_the_end(tmp_path: Path) -> None:
    (run,) = read_programme(_programme(tmp_path / "p"))
    assert run.program.shape == (1200, 7)
    assert np.all(run.program[:400, 2] == 0.0)
    assert np.all(run.program[400:, 2] == 2.5)
    assert np.all(run.program[400:, 5] == 0.5)


def test_a_folder_without_a_programme_is_refused(tmp_path: Path) -> None:
    with pytest.raises(BankError, match="holds no programme"):
        read_programme(tmp_path)


def test_a_bank_keeps_its_key_apart_and_benches_on_days_of_their_own(tmp_path: Path) -> None:
    order = CheckUps(
        folder=tmp_path / "bank", programme=_programme(tmp_path / "p"), cases=5, benches=1, seed=3
    )
    make(order)
    manifest = json.loads((order.folder / "manifest.json").read_text())
    key = json.loads((order.key_folder / "KEY.json").read_text())
    assert {c["id"] for c in manifest["cases"]} == set(key["cases"])
    assert not list(order.folder.rglob("KEY.json"))
    days = [
        (order.folder / "benches" / "bench-1" / f"good-{n}" / "run-1.parquet").read_bytes()
        for n in (1, 2)
    ]
    assert days[0] != days[1]
    with pytest.raises(BankError, match="already made"):
        make(order)


def test_other_days_have_no_effect_and_are_unlike_the_good_ones(tmp_path: Path) -> None:
    order = CheckUps(
        folder=tmp_path / "bank",
        programme=_programme(tmp_path / "p"),
        cases=5,
        benches=1,
        seed=3,
        mixture="other-days",
    )
    make(order)
    key = json.loads((order.key_folder / "KEY.json").read_text())["cases"]
    by_kind = {entry["kind"]: (case, entry) for case, entry in key.items()}
    assert set(by_kind) == {"none", "room", "preload", "parameters", "drift"}
    assert not any(entry["effects"] for _, entry in by_kind.values())
    assert by_kind["none"][1]["gap_worst"] == 0.0
    assert by_kind["preload"][1]["gap_worst"] > 0.0

    def room_degC(run: Path) -> float:
        return float(np.nanmean(read_run(run)["rtd_ambient_degC"]))

    case = order.folder / "cases" / by_kind["room"][0] / "run-1.parquet"
    good = order.folder / "benches" / "bench-1" / "good-1" / "run-1.parquet"
    assert room_degC(case) > room_degC(good) + 1.0


def test_sealing_makes_both_banks_and_enters_their_hashes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "results").mkdir()
    ledger = Ledger.of(tmp_path / "results")
    monkeypatch.setattr(Ledger, "of", lambda: ledger)
    monkeypatch.setattr(any_inputs, "SECONDS", (13.0, 15.0))
    few = ["--cases", "5", "--benches", "1", "--repeats", "1", "--changed", "0", "--differs", "2"]
    programme = str(_programme(tmp_path / "p"))
    main(["seal", str(tmp_path / "banks"), "--programme", programme, *few])
    sealed = [line.split()[0] for line in ledger.seals.read_text().splitlines()]
    assert len(sealed) == 2
    for n, bank in enumerate(("any-inputs", "check-ups")):
        manifest = json.loads((tmp_path / "banks" / bank / "manifest.json").read_text())
        path = tmp_path / "banks" / f"{bank}-key" / "KEY.json"
        key = json.loads(path.read_text())
        assert manifest["bank"] == key["bank"] == "sealed"
        assert manifest["key_sha256"] == sealed[n]
        hidden = {e["name"] for c in key["cases"].values() for e in c["effects"] if not e["known"]}
        assert hidden <= set(names("sealed"))
        assert [p.name for p in path.parent.iterdir()] == ["KEY.json"]
        ledger.require_sealed(sealed[n])
    folder = tmp_path / "banks"
    with pytest.raises(BankError, match="is sealed"):
        run(folder / "check-ups", tmp_path / "v.json", key=folder / "check-ups-key")
