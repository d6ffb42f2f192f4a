"""Banks of any inputs: reproducible from their seed, resumable, silent about their answers."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from evaluation.bank import any_inputs, files
from evaluation.bank.any_inputs import AnyInputs, make
from evaluation.bank.cases import draw, scaled
from evaluation.bank.excitation import HOT_degC
from evaluation.bank.making import SIGNALS
from evaluation.bank.recorder import record
from evaluation.command import main
from evaluation.errors import BankError
from evaluation.plant.effects import BY_NAME, EFFECTS, names
from evaluation.plant.layout import INLET, READINGS
from evaluation.plant.parameters import NAMES, Bench, another_bench


@pytest.fixture(autouse=True, scope="module")
def short() -> object:
    """Runs are cut to a few seconds."""
    patch = pytest.MonkeyPatch()
    patch.setattr(any_inputs, "SECONDS", (13.0, 15.0))
    yield patch
    patch.undo()


@pytest.fixture(scope="module")
def order(tmp_path_factory: pytest.TempPathFactory, short: object) -> AnyInputs:
    """A bank that was interrupted before its first case, and finished."""
    folder = tmp_path_factory.mktemp("banks") / "small"
    record(Bench(), (), "steps", 5, seconds=13.0)  # compiled here, and not in each process
    asked = AnyInputs(folder=folder, seed=11, changed=5, differs=2)
    assert make(replace(asked, minutes=0.0)) == ""
    assert make(asked)
    return asked


def test_a_case_has_good_runs_or_none_and_runs_to_fit_and_to_judge(order: AnyInputs) -> None:
    manifest = files.read_json(order.folder / "manifest.json")
    key = files.read_json(order.key_folder / "KEY.json")["cases"]
    kinds = {entry["kind"] for entry in key.values()}
    assert kinds == {"none", "parameters", "single", "unknown", "pair", "differs"}
    for case in manifest["cases"]:
        roles = [run["role"] for run in case["runs"]]
        families = [run["family"] for run in case["runs"] if run["role"] == "good"]
        assert len(set(families)) == len(families)
        assert roles.count("good") in ((0,) if case["question"] == "differs" else (3, 4))
        assert roles.count("fit") >= 2
        assert roles.count("hold_out") >= 1
        assert case["question"] == key[case["id"]]["question"]


def test_the_key_commits_to_the_runs(order: AnyInputs) -> None:
    sealed = files.read_json(order.key_folder / "KEY.json")["runs_sha256"]
    assert files.digest_of_runs(order.folder) == sealed
    run = next(order.folder.rglob("run-1.parquet"))
    data = run.read_bytes()
    run.write_bytes(data + b" ")
    assert files.digest_of_runs(order.folder) != sealed
    run.write_bytes(data)


def test_a_run_begins_where_the_strokes_before_it_left_the_bench() -> None:
    """It is as cold as its water, but its springs do not stand where they were mounted."""
    displacement, rtds = READINGS.index("displacement_mm"), slice(4, 6)
    away_mm = []
    for seed in range(6):
        bench = another_bench(np.random.default_rng(seed))
        run = record(bench, (), "steps", seed, seconds=20.0)
        first_second = run.grid[:100]
        away_mm.append(abs(first_second[:, displacement].mean()))
        assert np.ptp(first_second[:, displacement]) < 0.1
        assert np.abs(first_second[:, rtds].mean(axis=0) - run.inputs[0, INLET]).max() < 1.0
    assert np.median(away_mm) > 0.45
    assert max(away_mm) < 3.5


def test_what_counts_to_a_strength_on_one_spring_counts_on_the_other() -> None:
    assert {s.replace("_x", "_y") for s in SIGNALS} <= set(SIGNALS)


def test_a_run_may_repeat_the_commands_of_a_good_one_on_another_day(order: AnyInputs) -> None:
    key = files.read_json(order.key_folder / "KEY.json")["cases"]
    couples = [
        (order.folder / "cases" / case / f"{run}.parquet", good)
        for case, entry in key.items()
        for run, good in entry["repeats"].items()
    ]
    assert couples
    for path, good in couples:
        now, before = files.read_run(path), files.read_run(path.with_name(f"{good}.parquet"))
        shared, i, j = np.intersect1d(now["tick"], before["tick"], return_indices=True)
        assert len(shared) > 1000
        for side in "xy":
            cool = now[f"rtd_{side}_degC"][i] < HOT_degC - 1.0  # beyond, the bench stops heating
            assert cool.mean() > 0.8
            for command in (f"i_cmd_{side}_A", f"duty_{side}"):
                again, first = now[command][i][cool], before[command][j][cool]
                np.testing.assert_allclose(again, first, atol=5e-3)
        assert np.nanstd(now["rtd_inlet_degC"][i] - before["rtd_inlet_degC"][j]) > 0.0


def test_the_key_has_the_truth_of_each_effect_and_the_plants_own(order: AnyInputs) -> None:
    for entry in files.read_json(order.key_folder / "KEY.json")["cases"].values():
        assert bool(entry["own"]) == (entry["question"] == "differs")
        for effect in entry["effects"]:
            assert effect["places"]
            assert effect["states"]
            assert effect["side"] in ("x", "y", "both")
            assert effect["equation"]
        if entry["kind"] == "none":
            assert entry["gap_worst"] == 0.0


def test_the_manifest_pins_the_key_that_lies_apart(order: AnyInputs) -> None:
    manifest = files.read_json(order.folder / "manifest.json")
    assert manifest["key_sha256"] == files.digest(order.key_folder / "KEY.json")
    assert not list(order.folder.rglob("*KEY*"))
    assert not order.parts.exists()


def test_nothing_in_the_bank_folder_tells_an_answer(order: AnyInputs) -> None:
    words = [e.name for e in EFFECTS] + [n for n in NAMES if n not in files.UNITS]
    words += ['"kind"', "magnitude", "seed", "floors", "gap_worst", "repeats"]
    for path in order.folder.rglob("*"):
        raw = b"" if path.is_dir() else path.read_bytes()
        assert not [w for w in words if w.encode() in raw], path.name


def test_a_case_is_the_same_from_the_same_seed(order: AnyInputs, tmp_path: Path) -> None:
    case = draw(11, scaled(any_inputs.MIXTURE, 5) | {"differs": 2}, sealed=False)[0]
    manifest, key = any_inputs.make_case(tmp_path, case)
    assert key == files.read_json(order.key_folder / "KEY.json")["cases"][case.name]
    for run in manifest["runs"]:
        assert (tmp_path / run["file"]).read_bytes() == (order.folder / run["file"]).read_bytes()


def test_a_finished_bank_is_not_overwritten(order: AnyInputs) -> None:
    with pytest.raises(BankError, match="already made"):
        make(order)


def test_other_options_do_not_resume_a_begun_bank(tmp_path: Path) -> None:
    begun = AnyInputs(folder=tmp_path / "bank", seed=1, changed=5, minutes=0.0)
    assert make(begun) == ""
    with pytest.raises(BankError, match="begun with other options"):
        make(replace(begun, changed=7))


def test_a_sealed_bank_draws_its_seed_in_secret(tmp_path: Path) -> None:
    seeds = set()
    for i in range(2):
        begun = AnyInputs(folder=tmp_path / f"bank-{i}", sealed=True, minutes=0.0)
        assert make(begun) == ""
        seeds.add(files.read_json(begun.parts / "order.json")["seed"])
    assert len(seeds) == 2


def test_run_logs_have_units_gaps_and_jitter(order: AnyInputs) -> None:
    logs = [files.read_run(path) for path in sorted(order.folder.rglob("*.parquet"))[:6]]
    for log in logs:
        assert set(log) == set(files.UNITS)
        steps = np.diff(log["t_s"])
        assert (steps > 0).all()
        assert steps.max() > 0.025
        assert 1e-5 < np.std(steps[steps < 0.015]) < 1e-3
        assert max(np.nanmax(log["i_cmd_x_A"]), np.nanmax(log["i_cmd_y_A"])) <= 4.0
        assert np.nanmax(log["rtd_x_degC"]) < 70.0
    assert any(np.isnan(log[c]).any() for log in logs for c in log)


@pytest.fixture
def log(order: AnyInputs) -> files.Log:
    return files.read_run(next(order.folder.rglob("*.parquet")))


def test_csv_and_parquet_hold_the_same_run(log: files.Log, tmp_path: Path) -> None:
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
def test_a_damaged_run_file_is_named(name: str, log: files.Log, tmp_path: Path) -> None:
    path = tmp_path / name
    if name == "run.csv":
        path.write_text("t_s,i_x_A\n0,1,2\n1,2,3\n")
    else:
        files.write_run(path, log)
        path.write_bytes(path.read_bytes()[:2000])
    with pytest.raises(BankError, match=rf"{name} cannot be read .*restore it"):
        files.read_run(path)


def test_dev_and_sealed_banks_have_different_unknown_effects() -> None:
    unknown = {}
    for sealed in (False, True):
        drawn = draw(5, {"unknown": 124}, sealed=sealed)
        unknown[sealed] = {a.name for c in drawn for one in c.choices for a in one}
    assert unknown[False] == set(names("dev"))
    assert unknown[True] == set(names("sealed"))


def test_a_bank_without_effects_to_draw_from_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("evaluation.bank.cases.names", lambda pool: ())
    with pytest.raises(BankError, match="no effects to draw from"):
        draw(5, {"unknown": 3}, sealed=True)


def test_half_of_the_effects_of_single_springs_act_on_one_of_them() -> None:
    sides = [c.choices[0][0].side for c in draw(6, {"single": 200}, sealed=False)]
    assert 0.1 < sides.count("x") / 200 < 0.3
    assert 0.1 < sides.count("y") / 200 < 0.3


def test_an_effect_that_one_spring_has_by_nature_is_never_on_both() -> None:
    drawn = [c.choices[0][0] for c in draw(7, {"unknown": 60}, sealed=True)]
    sides = [a.side for a in drawn if BY_NAME[a.name].side == "one"]
    assert set(sides) == {"x", "y"}


def test_the_command_says_what_is_wrong_in_one_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "manifest.json").write_text("{}")
    with pytest.raises(SystemExit) as stop:
        main(["make", str(tmp_path), "--seed", "3"])
    assert stop.value.code == 2
    said = capsys.readouterr().err
    assert said.startswith("error: ")
    assert "Traceback" not in said


def test_an_interrupted_command_ends_with_a_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def interrupt(order: AnyInputs) -> str:
        raise KeyboardInterrupt

    monkeypatch.setattr(any_inputs, "make", interrupt)
    with pytest.raises(SystemExit) as stop:
        main(["make", str(tmp_path / "bank"), "--seed", "3"])
    assert stop.value.code == 130
    assert "the same command goes on" in capsys.readouterr().err
