"""A bank: reproducible from its seed, resumable, and silent about its answers."""

import io
import json
import shutil
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from evaluation.bank import files
from evaluation.bank import recorded as bank
from evaluation.bank.cases import DEFAULT, FULL, draw, plan
from evaluation.bank.making import Style, make
from evaluation.command import main
from evaluation.errors import BankError
from evaluation.plant.effects import EFFECTS, names
from evaluation.plant.parameters import NAMES


@pytest.fixture(scope="module")
def mini(tmp_path_factory: pytest.TempPathFactory) -> bank.Order:
    order = bank.Order("mini", tmp_path_factory.mktemp("banks"), jobs=1)
    bank.make_bank(order, io.StringIO())
    return order


def test_a_mini_bank_has_every_kind_and_six_runs_a_case(mini: bank.Order) -> None:
    manifest = files.read_json(mini.folder / "manifest.json")
    key = files.read_json(mini.key_folder / "KEY.json")
    kinds = sorted(c["kind"] for c in key["cases"].values())
    assert kinds == ["none", "pair", "parameters", "single", "unknown"]
    for case in manifest["cases"]:
        roles = [run["role"] for run in case["runs"]]
        assert sorted(roles) == ["fit"] * 4 + ["good"] * 3 + ["hold_out"] * 2
        families = {role: {r["family"] for r in case["runs"] if r["role"] == role}
                    for role in ("fit", "hold_out")}  # fmt: skip
        assert not families["fit"] & families["hold_out"]


def test_the_manifest_pins_the_key_that_lies_apart(mini: bank.Order) -> None:
    manifest = files.read_json(mini.folder / "manifest.json")
    assert manifest["key_sha256"] == files.digest(mini.key_folder / "KEY.json")
    assert not list(mini.folder.rglob("*KEY*"))


def test_nothing_in_the_bank_folder_tells_an_answer(mini: bank.Order) -> None:
    words = [e.name for e in EFFECTS] + [n for n in NAMES if n not in files.UNITS]
    words += ['"kind"', "magnitude", "seed", "floors", "gap_worst"]
    key = files.read_json(mini.key_folder / "KEY.json")
    seeds = {str(s) for c in key["cases"].values() for s in c["run_seeds"]}
    for path in mini.folder.rglob("*"):
        if path.is_dir():
            continue
        raw = path.read_bytes()
        found = [w for w in words if w.encode() in raw]
        assert not found, f"{path.name} tells {found}"
        if path.suffix == ".json":
            assert not [s for s in seeds if s in raw.decode()]


def test_a_bank_is_the_same_from_the_same_seed(mini: bank.Order, tmp_path: Path) -> None:
    cases, style = bank.planned(mini, bank.MINI_SEED)
    manifest, key = make(cases[0], tmp_path, style)
    whole = files.read_json(mini.key_folder / "KEY.json")
    assert json.loads(json.dumps(key)) == whole["cases"][cases[0].name]
    for run in manifest["runs"]:
        assert (tmp_path / run["file"]).read_bytes() == (mini.folder / run["file"]).read_bytes()


def test_a_bank_cut_short_is_taken_up_again_where_it_stopped(
    mini: bank.Order, tmp_path: Path
) -> None:
    again = replace(mini, out=tmp_path)
    shutil.copytree(mini.folder, again.folder)
    (again.folder / "manifest.json").unlink()
    parts = again.key_folder / "parts"
    parts.mkdir(parents=True)
    key = files.read_json(mini.key_folder / "KEY.json")
    for entry in files.read_json(mini.folder / "manifest.json")["cases"]:
        part = {"manifest": entry, "key": key["cases"][entry["id"]]}
        files.write_json(parts / f"{entry['id']}.json", part)
    (again.folder / files.read_json(mini.folder / "manifest.json")["cases"][0]["runs"][0]["file"]
     ).unlink()  # fmt: skip
    shown = io.StringIO()
    assert bank.make_bank(again, shown) == files.digest(mini.key_folder / "KEY.json")
    assert shown.getvalue().count("cases") == 1


def test_a_finished_bank_is_not_overwritten(mini: bank.Order) -> None:
    with pytest.raises(BankError, match="already made"):
        bank.make_bank(mini, io.StringIO())


def test_another_seed_does_not_resume_a_begun_bank(tmp_path: Path) -> None:
    order = bank.Order("dev", tmp_path, seed=1)
    order.key_folder.mkdir()
    files.write_json(order.key_folder / "seed.json", {"seed": 2})
    with pytest.raises(BankError, match="another seed"):
        bank.make_bank(order, io.StringIO())


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"cases": 30}, "begun with --cases 20, not --cases 30"),
        ({"cases": None}, "begun with --cases 20, not no --cases"),
        ({"full": True}, "begun with no --full, not --full"),
        ({"suffix": ".csv.gz"}, "begun with no --csv, not --csv"),
    ],
)
def test_other_options_do_not_resume_a_begun_bank(
    change: dict[str, Any], words: str, tmp_path: Path
) -> None:
    order = bank.Order("dev", tmp_path, cases=20)
    order.key_folder.mkdir()
    seed = bank._settled_seed(order)
    assert bank._settled_seed(order) == seed
    with pytest.raises(BankError, match=words):
        bank.make_bank(replace(order, **change), io.StringIO())


def test_a_bank_begun_before_options_were_kept_is_resumed(tmp_path: Path) -> None:
    order = bank.Order("dev", tmp_path, cases=20)
    order.key_folder.mkdir()
    files.write_json(order.key_folder / "seed.json", {"seed": 2})
    assert bank._settled_seed(order) == 2


class Interrupted(io.StringIO):
    """A terminal at which ctrl-C is pressed once the first case is ready."""

    def write(self, text: str) -> int:
        raise KeyboardInterrupt


def test_an_interruption_does_not_wait_for_the_cases_that_are_left(tmp_path: Path) -> None:
    order = bank.Order("mini", tmp_path)
    with pytest.raises(KeyboardInterrupt):
        bank.make_bank(order, Interrupted())
    assert len(list((order.key_folder / "parts").glob("*.json"))) == 1
    assert len(list((order.folder / "cases").iterdir())) < 5


def test_an_interrupted_command_ends_with_a_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def interrupt(order: bank.Order) -> str:
        raise KeyboardInterrupt

    monkeypatch.setattr(bank, "make_bank", interrupt)
    with pytest.raises(SystemExit) as stop:
        main(["make", "mini", "--out", str(tmp_path)])
    assert stop.value.code == 130
    assert "the same command goes on" in capsys.readouterr().err


def test_run_logs_have_units_gaps_and_jitter(mini: bank.Order) -> None:
    manifest = files.read_json(mini.folder / "manifest.json")
    logs = [files.read_run(mini.folder / r["file"]) for r in manifest["cases"][0]["runs"]]
    for log in logs:
        assert set(log) == set(files.UNITS)
        steps = np.diff(log["t_s"])
        assert (steps > 0).all()
        assert steps.max() > 0.025
        assert 1e-5 < np.std(steps[steps < 0.015]) < 1e-3
        assert max(np.nanmax(log["i_cmd_x_A"]), np.nanmax(log["i_cmd_y_A"])) <= 4.0
        assert np.nanmax(log["rtd_x_degC"]) < 70.0
        rest = log["t_s"] < log["t_s"][0] + 3.5
        assert log["i_cmd_x_A"][rest].max() == 0.0
    assert any(np.isnan(log[c]).any() for log in logs for c in log)


def test_csv_and_parquet_hold_the_same_run(mini: bank.Order, tmp_path: Path) -> None:
    first = files.read_json(mini.folder / "manifest.json")["cases"][0]["runs"][0]["file"]
    log = files.read_run(mini.folder / first)
    files.write_run(tmp_path / "run.csv.gz", log)
    again = files.read_run(tmp_path / "run.csv.gz")
    for name in ("t_s", "displacement_mm", "rtd_x_degC"):
        np.testing.assert_allclose(again[name], log[name], atol=1e-6)


def test_a_missing_or_foreign_run_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(BankError, match=r"run-9\.parquet is missing"):
        files.read_run(tmp_path / "run-9.parquet")
    (tmp_path / "run.mat").write_bytes(b"x")
    with pytest.raises(BankError, match="convert it"):
        files.read_run(tmp_path / "run.mat")


@pytest.mark.parametrize("name", ["run.parquet", "run.csv.gz", "run.csv"])
def test_a_damaged_run_file_is_named(name: str, mini: bank.Order, tmp_path: Path) -> None:
    first = files.read_json(mini.folder / "manifest.json")["cases"][0]["runs"][0]["file"]
    path = tmp_path / name
    if name == "run.csv":
        path.write_text("t_s,i_x_A\n0,1,2\n1,2,3\n")
    else:
        files.write_run(path, files.read_run(mini.folder / first))
        path.write_bytes(path.read_bytes()[:2000])
    with pytest.raises(BankError, match=rf"{name} cannot be read .*restore it"):
        files.read_run(path)


def test_the_full_mixtures_are_as_announced() -> None:
    assert sum(DEFAULT.values()) == 150
    assert sum(FULL.values()) == 440
    cases = draw("dev", 3, DEFAULT, 4)
    assert len(cases) == 154
    strengths = [c.target for c in cases if c.kind == "single"]
    assert {s: strengths.count(s) for s in (1.0, 3.0, 10.0)} == {1.0: 20, 3.0: 20, 10.0: 20}


def test_dev_and_sealed_banks_have_different_unknown_effects() -> None:
    unknown = {}
    for name in ("dev", "sealed"):
        drawn = draw(name, 5, DEFAULT, 0)
        unknown[name] = {
            a.name for c in drawn if c.kind == "unknown" for one in c.choices for a in one
        }
    assert len(unknown["dev"]) >= 12
    assert len(unknown["sealed"]) >= 12
    assert not unknown["dev"] & unknown["sealed"]
    assert not set(names("spent")) & (unknown["dev"] | unknown["sealed"])


def test_a_sealed_bank_draws_its_seed_in_secret(tmp_path: Path) -> None:
    seeds = set()
    for i in range(2):
        order = bank.Order("sealed", tmp_path / str(i))
        order.key_folder.mkdir(parents=True)
        seeds.add(bank._settled_seed(order))
    assert len(seeds) == 2


def test_held_out_runs_come_from_other_families() -> None:
    for seed in range(20):
        runs = plan(np.random.default_rng(seed)).runs
        fit = {family for family, _, role in runs if role == "fit"}
        held_out = {family for family, _, role in runs if role == "hold_out"}
        assert len(fit) == 4
        assert len(held_out) == 2
        assert not fit & held_out


def test_the_command_says_what_is_wrong_in_one_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "mini").mkdir()
    (tmp_path / "mini" / "manifest.json").write_text("{}")
    with pytest.raises(SystemExit) as stop:
        main(["make", "mini", "--out", str(tmp_path)])
    assert stop.value.code == 2
    said = capsys.readouterr().err
    assert said.startswith("error: ")
    assert "Traceback" not in said


def test_style_of_a_mini_bank_is_short(mini: bank.Order) -> None:
    _, style = bank.planned(mini, 1)
    assert style == Style(40.0, ".parquet", search=False)
