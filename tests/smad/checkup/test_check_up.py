"""A bench as its own control, on short programmes of the simulated bench."""

import io
import json
import shutil
import tracemalloc
import zipfile
from dataclasses import replace
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pytest

from evaluation.programme.segments import run_of
from evaluation.programme.writing import write_programme
from smad.checkup.check import check_files, checked_files
from smad.checkup.errors import BaselineError, ProgrammeError
from smad.checkup.files import RunFile, read_file, read_folder, require_other_recordings
from smad.checkup.judge import Judgement, commissioned, judge_runs
from smad.checkup.programme import (
    Programme,
    ProgrammeRun,
    read_programme,
    shipped,
)
from smad.checkup.store import SCHEMA, Baseline, load, save
from smad.diagnosis.data.played import predictions
from smad.diagnosis.errors import PairingError
from smad.diagnosis.paired.good import GoodRuns
from smad.diagnosis.report.page import page_of
from smad.diagnosis.report.words import lines
from smad.diagnosis.runs import GapRun
from smad.diagnosis.spring_pair import SmaPlant
from smad.diagnosis.verdict import PAIRED, Verdict
from smad.errors import SmadError
from smad.report.page import render
from smad.runlog.header import RunHeader
from smad.runlog.writer import write_run

from .short import PLANT, SHORT, played

LAG = {"rtd_lag": {"tau_s": 0.1, "y_share": 1.0}}


@pytest.fixture(scope="module")
def reference() -> GoodRuns:
    return commissioned(PLANT, [[played(seed) for seed in (1, 2, 3)]])


def checked(plant: SmaPlant, reference: GoodRuns, runs: list[tuple[GapRun, str]]) -> Verdict:
    return judge_runs(plant, reference, runs).verdict


def named(verdict: Verdict) -> list[str]:
    return [c.name for c in verdict.causes if c.name]


def value(verdict: Verdict, name: str, parameter: str) -> float:
    cause = next(c for c in verdict.causes if c.name == name)
    return next(v.value for v in cause.values if v.name == parameter)


@pytest.fixture(scope="module")
def stored(reference: GoodRuns, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of a baseline; a test changes a copy of it."""
    folder = tmp_path_factory.mktemp("stored")
    save(Baseline("bench", "digest", reference), PLANT, folder)
    return folder


@pytest.fixture(scope="module")
def quiet(reference: GoodRuns) -> Judgement:
    return judge_runs(PLANT, reference, [(played(10), "short")])


def test_a_bench_without_a_change_is_quiet_and_says_what_it_would_not_have_shown(
    quiet: Judgement,
) -> None:
    verdict = quiet.verdict
    assert verdict.outcome == "quiet"
    assert (verdict.gaps_of, [r.role for r in verdict.runs]) == (PAIRED, ["fit"])
    assert verdict.runs[0].duration_s > 20.0
    assert [r.name for r in verdict.runs] == [g.run for g in verdict.by_run]
    assert verdict.runs[0].repeats == "short"
    assert verdict.whole is not None
    assert verdict.whole.raw < 1.5
    assert any(text.startswith("rtd_lag, tau_s: less than") for text in verdict.unseen)


def test_a_lagging_sensor_is_named_with_its_value(reference: GoodRuns) -> None:
    now = played(11, {"rtd_lag": {"tau_s": 0.3, "y_share": 1.0}})
    verdict = checked(PLANT, reference, [(now, "short")])
    assert verdict.outcome == "causes"
    assert verdict.causes[0].place == "reading_rtd"
    assert named(verdict) == ["rtd_lag"]
    assert value(verdict, "rtd_lag", "tau_s") == pytest.approx(0.3, rel=0.1)


def test_the_budget_goes_down_to_the_floor(reference: GoodRuns) -> None:
    now = played(12, {"force_offset": {"offset_N": 0.05}})
    verdict = checked(PLANT, reference, [(now, "short")])
    force = next(s for s in verdict.budget if s.signal == "force_N")
    assert force.raw > 10.0 * force.floor
    assert force.final < 2.0 * force.floor


def test_the_page_shows_rivals_values_and_what_is_told(
    reference: GoodRuns, quiet: Judgement
) -> None:
    now = played(20, LAG)
    found = judge_runs(PLANT, reference, [(now, "short")])
    page = render(page_of(found, facts=[("baseline", "somewhere")]))
    for words in (
        "changed at the reading of the RTD", "rtd_lag", "parameters alone", "tau_s",
        "What these runs would not have shown",
    ):  # fmt: skip
        assert words in page
    assert "No change beyond the repeat floor" in render(page_of(quiet))


def test_the_model_of_the_good_bench_has_what_its_runs_show() -> None:
    slow = {"rtd_lag": {"tau_s": 0.6}}
    reference = commissioned(PLANT, [[played(seed, slow) for seed in (1, 2, 3)]])
    assert set(reference.point.effects) == {"rtd_lag"}
    assert reference.point.effects["rtd_lag"]["tau_s"] == pytest.approx(0.6, rel=0.05)
    now = played(31, slow | {"driver_gain": {"gain": 0.06}})
    verdict = checked(PLANT, reference, [(now, "short")])
    assert named(verdict) == ["driver_gain"]
    assert verdict.notes[0] == "the model has what the good runs show: rtd_lag"


def test_a_sensor_of_the_model_gets_what_the_good_runs_measured() -> None:
    """A delay leaves nothing though the model of the good bench is off by many floors."""
    unaware = replace(PLANT, only=("channel_delay", "rtd_lag", "encoder_backlash"))
    front = {"cooling_front": {"share": 0.8}, "temperature_spread": {"spread_K": 4.0}}
    reference = commissioned(unaware, [[played(seed, front) for seed in (1, 2, 3)]])
    (run,) = reference.runs
    (as_measured,) = predictions(unaware, reference.point, [run.as_measured(unaware)], exact=True)
    off, closer = (np.where(run.valid, x - run.mean, 0.0) for x in (run.base, as_measured))
    for name in ("rtd_x_degC", "displacement_mm", "force_N"):
        c = [channel.name for channel in unaware.channels].index(name)
        assert (closer[:, c] ** 2).mean() < 0.05 * (off[:, c] ** 2).mean(), name
    late = front | {"channel_delay": {"displacement_s": 0.1, "temperature_s": 0.0, "force_s": 0.1}}
    verdict = checked(unaware, reference, [(played(32, late), "short")])
    assert named(verdict) == ["channel_delay"]
    assert value(verdict, "channel_delay", "displacement_s") == pytest.approx(0.1, rel=0.15)
    assert verdict.causes[0].gap < 1.3


def test_two_causes_are_named_together(reference: GoodRuns) -> None:
    both = {"driver_gain": {"gain": 0.06, "y_share": 1.0}, **LAG}
    verdict = checked(PLANT, reference, [(played(13, both), "short")])
    assert sorted(named(verdict)) == ["driver_gain", "rtd_lag"]


def test_what_no_effect_explains_has_a_place_and_no_name(reference: GoodRuns) -> None:
    now = played(14)
    bent = now.outputs["displacement_mm"] + 0.3 * np.sin(now.t_s)
    verdict = checked(
        PLANT, reference, [(now.with_columns(outputs={"displacement_mm": bent}), "short")]
    )
    assert verdict.outcome == "unexplained"
    assert named(verdict) == []


def test_what_other_values_of_the_parameters_explain_is_theirs(reference: GoodRuns) -> None:
    moved = {"resistivity": 1.03, "modulus_martensite": 0.95, "initial_force": 1.02}
    verdict = checked(PLANT, reference, [(played(16, moved=moved), "short")])
    assert (verdict.outcome, verdict.causes) == ("parameters", [])
    first = verdict.parameters[0]
    assert first.name == "resistivity"
    assert first.after == pytest.approx(1.03 * first.before, rel=0.005)
    assert any("moved  resistivity" in line for line in lines(verdict))


def test_what_parameters_imitate_has_the_right_effect_first_among_the_effects(
    reference: GoodRuns,
) -> None:
    now = played(17, {"force_offset": {"offset_N": 0.1}})
    verdict = checked(PLANT, reference, [(now, "short")])
    rivals = verdict.causes[0].rivals if verdict.causes else verdict.rivals
    effects = [r.name for r in rivals if r.kind == "effect"]
    assert effects[0] == "force_offset"


def test_warmer_water_is_carried_over_and_told(reference: GoodRuns) -> None:
    verdict = checked(PLANT, reference, [(played(15, water_degC=28.5), "short")])
    assert verdict.outcome in ("quiet", "parameters")
    assert any("rtd_inlet_degC +1.5 K" in note for note in verdict.notes)


CUT = run_of(
    "short",
    "the same, with current cut off for the last 0.6 s of heating X, as a board does in a fault",
    [(3.0, 0, 0, 0, 0), (2.4, 3.0, 0, 0, 0), (0.6, 0, 0, 0, 0), (3.0, 0, 0, 0.8, 0),
     (2.0, 0, 0, 0, 0), (3.0, 0, 2.8, 0, 0), (4.0, 0, 0, 0, 0.6), (2.0, 1.5, 0, 0, 0),
     (4.0, 0, 0, 1, 1)],
)  # fmt: skip


def test_a_current_that_was_cut_off_is_carried_over(reference: GoodRuns) -> None:
    found = judge_runs(PLANT, reference, [(played(21, what=CUT), "short")])
    assert found.pairs.pairs[0].carried
    assert found.verdict.outcome in ("quiet", "parameters")


def test_a_cause_is_named_at_the_inputs_that_were_played(reference: GoodRuns) -> None:
    now = played(22, {"driver_gain": {"gain": 0.05, "y_share": 1.0}}, what=CUT)
    verdict = checked(PLANT, reference, [(now, "short")])
    assert named(verdict) == ["driver_gain"]
    assert value(verdict, "driver_gain", "gain") == pytest.approx(0.05, rel=0.1)


def test_a_run_that_was_cut_short_counts_as_far_as_it_goes(reference: GoodRuns) -> None:
    now = played(16, {"rtd_lag": {"tau_s": 0.1, "y_share": 1.0}})
    verdict = checked(PLANT, reference, [(now.part(0, len(now.t_s) // 2), "short")])
    assert named(verdict) == ["rtd_lag"]
    assert any("counts as far as it goes" in note for note in verdict.notes)


def test_other_inputs_are_refused(reference: GoodRuns) -> None:
    now = played(17)
    swapped = {"i_applied_x_A": now.inputs["i_applied_y_A"] * 1.3 + 2.0}
    with pytest.raises(PairingError, match="other inputs"):
        checked(PLANT, reference, [(now.with_columns(inputs=swapped), "short")])


def test_a_baseline_judges_the_same_after_it_was_stored(
    reference: GoodRuns, tmp_path: Path
) -> None:
    save(Baseline("bench", "digest", reference), PLANT, tmp_path)
    again = load(tmp_path, PLANT)
    now = played(18, {"driver_gain": {"gain": 0.02, "y_share": 1.0}})
    first, second = (checked(PLANT, r, [(now, "short")]) for r in (reference, again.reference))
    assert again.bench == "bench"
    assert named(first) == named(second) == ["driver_gain"]
    assert first.whole is not None
    assert second.whole is not None
    assert second.whole.raw == pytest.approx(first.whole.raw, rel=1e-6)


def test_a_baseline_of_another_library_or_schema_is_refused(
    reference: GoodRuns, tmp_path: Path
) -> None:
    save(Baseline("bench", "digest", reference), PLANT, tmp_path)
    fewer = tuple(e.name for e in PLANT.effects[1:])
    for other in (SmaPlant(variant="printed"), SmaPlant(only=fewer)):
        with pytest.raises(BaselineError, match="another model or library"):
            load(tmp_path, other)
    about = (tmp_path / "baseline.json").read_text()
    (tmp_path / "baseline.json").write_text(about.replace(f'"schema": {SCHEMA}', '"schema": 1'))
    with pytest.raises(BaselineError, match="another version"):
        load(tmp_path, PLANT)


def test_arrays_of_another_baseline_are_refused_and_say_what_to_do(
    reference: GoodRuns, tmp_path: Path
) -> None:
    for name, runs in (("one", reference.runs), ("other", reference.runs[:1])):
        save(Baseline("bench", name, replace(reference, runs=runs)), PLANT, tmp_path / name)
    assert load(tmp_path / "one", PLANT).programme == "one"
    arrays = tmp_path / "one" / "reference.npz"
    arrays.write_bytes((tmp_path / "other" / "reference.npz").read_bytes() + b" ")
    with pytest.raises(BaselineError, match=r"two baselines are mixed.*computed anew"):
        load(tmp_path / "one", PLANT)


def test_arrays_that_are_cut_off_are_not_called_those_of_another_baseline(
    reference: GoodRuns, tmp_path: Path
) -> None:
    save(Baseline("bench", "digest", reference), PLANT, tmp_path)
    arrays = tmp_path / "reference.npz"
    arrays.write_bytes(arrays.read_bytes()[:5000])
    with pytest.raises(BaselineError, match=r"reference\.npz is cut off or damaged.*anew"):
        load(tmp_path, PLANT)


def test_a_baseline_without_its_digest_that_is_torn_is_refused(
    reference: GoodRuns, tmp_path: Path
) -> None:
    save(Baseline("bench", "digest", reference), PLANT, tmp_path)
    about, arrays = tmp_path / "baseline.json", tmp_path / "reference.npz"
    data = msgspec.json.decode(about.read_bytes()) | {"arrays": ""}
    about.write_bytes(msgspec.json.encode(data))
    arrays.write_bytes(arrays.read_bytes()[:5000])
    with pytest.raises(BaselineError, match="cannot be read"):
        load(tmp_path, PLANT)
    arrays.unlink()
    with pytest.raises(BaselineError, match=r"cannot be read: No such file"):
        load(tmp_path, PLANT)


def test_a_sensor_that_is_missing_now_is_told(reference: GoodRuns) -> None:
    run = played(41)
    outputs = {k: v for k, v in run.outputs.items() if k != "force_N"}
    outputs["displacement_mm"] = np.full(len(run.t_s), np.nan)
    verdict = checked(PLANT, reference, [(replace(run, outputs=outputs), "short")])
    assert "recorded then and not now, and left out: displacement_mm (short), force_N (short)" in (
        verdict.notes
    )


def test_runs_of_two_boards_and_a_recording_given_twice_are_refused(tmp_path: Path) -> None:
    def found(name: str, seed: int, board: str = "") -> RunFile:
        return RunFile(tmp_path / name, played(seed), board)

    one, other = found("one", 1, "board-1"), found("other", 2, "board-2")
    with pytest.raises(PairingError, match=r"two benches are mixed.*one of board board-1"):
        checked_files(PLANT, [one], [other])
    with pytest.raises(PairingError, match=r"copy is the same recording as .*leave one out"):
        checked_files(PLANT, [found("first", 1), found("copy", 1)], [found("now", 2)])
    with pytest.raises(PairingError, match=r"export is the same recording as .*leave one out"):
        checked_files(PLANT, [found("good", 1)], [found("now", 2), found("export", 2)])


def test_a_log_that_was_cut_before_its_first_sample_is_told(tmp_path: Path) -> None:
    path = tmp_path / "run-1.mcap"
    write_run(path, RunHeader(source="sim", rate_hz=100.0), [])
    with pytest.raises(PairingError, match="holds no sample"):
        read_file(path)


def _write(path: Path, run: GapRun) -> None:
    """A CSV with the names and units of another laboratory."""
    path.parent.mkdir(parents=True, exist_ok=True)
    names = {
        "i_applied_x_A": ("current_applied_x (mA)", 1e3),
        "displacement_mm": ("Displacement [m]", 1e-3),
        "rtd_x_degC": ("T_x_K", 1.0),
    }
    columns = {"time_ms": 1e3 * run.t_s}
    for name, values in {**run.inputs, **run.outputs}.items():
        label, factor = names.get(name, (name, 1.0))
        columns[label] = factor * values + (273.15 if label == "T_x_K" else 0.0)
    table = np.column_stack(list(columns.values()))
    np.savetxt(path, table, delimiter=",", header=",".join(columns), comments="", fmt="%.9g")


def test_files_of_another_laboratory_are_paired_by_their_inputs(tmp_path: Path) -> None:
    for k, seed in enumerate((1, 2)):
        _write(tmp_path / "good" / f"day-{k}" / "a.csv", played(seed))
    _write(
        tmp_path / "now" / "renamed.csv",
        played(20, {"driver_gain": {"gain": 0.06, "y_share": 1.0}}),
    )
    found, matched = checked_files(
        PLANT, read_folder(tmp_path / "good"), read_folder(tmp_path / "now")
    )
    assert named(found.verdict) == ["driver_gain"]
    assert "repeats 2 good runs" in matched.lines[0]


def test_notes_that_differ_in_numbers_alone_are_said_once(tmp_path: Path) -> None:
    for day, lost in ((1, 3), (2, 4), (10, 5)):
        path = tmp_path / ("now" if day == 10 else "good") / f"day-{day}" / "a.csv"
        _write(path, played(day))
        rows = path.read_text().splitlines()
        for row in range(20, 20 + lost):
            rows[row] = rows[row].split(",")[0] + "," * rows[row].count(",")
        path.write_text("\n".join(rows) + "\n")
    said: list[str] = []
    check_files(PLANT, tmp_path / "good", tmp_path / "now", say=said.append, progress=said.append)
    (line,) = (text for text in said if "without a number" in text)
    assert line.endswith("; likewise in 2 more runs")


def test_a_hole_ends_a_run_of_now_and_a_good_one_and_is_told(tmp_path: Path) -> None:
    """What was applied in a hole is not known; the other repeats of a good run go on after it."""
    for day in (1, 2, 3):
        _write(tmp_path / "good" / f"day-{day}" / "a.csv", played(day))
    _write(tmp_path / "now" / "a.csv", played(10))
    for file in ("good/day-1/a.csv", "now/a.csv"):
        rows = (tmp_path / file).read_text().splitlines()
        n = len(rows)
        (tmp_path / file).write_text("\n".join(rows[: n // 2] + rows[n // 2 + 150 :]) + "\n")
    good, now = read_folder(tmp_path / "good"), read_folder(tmp_path / "now")
    for run in (good[0], now[0]):
        assert run.run.duration_s == pytest.approx(SHORT.duration_s / 2, abs=0.1)
        assert "is not recorded: the run is used up to" in " ".join(run.run.notes)
    judgement, _ = checked_files(PLANT, good, now)
    assert judgement.verdict.outcome == "quiet"
    (pair,) = judgement.pairs.pairs
    assert pair.share == pytest.approx(0.5, abs=0.03)
    assert any("counts as far as it goes" in note for note in judgement.verdict.notes)
    (reference,) = judgement.pairs.good.runs
    assert reference.count[-5:].max() == 2
    assert reference.count[: len(reference.count) // 3].max() == 3


def test_good_runs_of_two_days_have_one_name_and_a_copy_among_them_is_told_with_its_folder(
    tmp_path: Path,
) -> None:
    good, now = tmp_path / "good", [RunFile(tmp_path / "now", played(3))]
    for day in (1, 2):
        _write(good / f"day-{day}" / "run-1.csv", played(day))
    require_other_recordings(read_folder(good), now)
    _write(good / "day-3" / "run-1.csv", played(1))
    said = r"good/day-3/run-1\.csv is the same recording as .*good/day-1/run-1\.csv"
    with pytest.raises(PairingError, match=said):
        require_other_recordings(read_folder(good), now)


def test_a_recording_that_is_on_both_sides_is_refused(tmp_path: Path) -> None:
    _write(tmp_path / "good" / "a.csv", played(1))
    _write(tmp_path / "now" / "b.csv", played(1))
    with pytest.raises(PairingError, match="same recording"):
        checked_files(PLANT, read_folder(tmp_path / "good"), read_folder(tmp_path / "now"))


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("a,b\n1,2\n", "no time column"),
        ("time_s,i_applied_x_A\n0,1\n1,1\n", "lacks columns"),
        ("time_s,current_x\n0,1\n1,1\n", "unit is missing"),
        ("time_s,force_N\n0,x\n1,y\n", "is not a number"),
        ("", "is empty"),
    ],
)
def test_a_file_that_cannot_be_used_says_why(tmp_path: Path, text: str, said: str) -> None:
    path = tmp_path / "run.csv"
    path.write_text(text)
    with pytest.raises(SmadError, match=said):
        read_file(path)


def test_a_programme_comes_back_as_it_was_written(tmp_path: Path) -> None:
    programme = Programme("p", 'with "quotes"', (replace(SHORT, quick=True),))
    write_programme(programme, tmp_path)
    again = read_programme(tmp_path)
    assert again.digest == programme.digest
    assert again.title == programme.title
    assert again.runs[0].quick


def test_a_programme_with_too_much_current_is_refused() -> None:
    with pytest.raises(ProgrammeError, match="i_x_A leaves its range"):
        ProgrammeRun(
            name="hot",
            title="",
            t_s=np.array([0.0]),
            inputs=np.array([[4.5, 0.0, 0.0, 0.0]]),
            duration_s=5.0,
        )


def test_the_shipped_programme_has_a_quick_part_of_three_minutes() -> None:
    programme = shipped()
    assert 400.0 <= programme.duration_s <= 660.0
    assert 0.0 < programme.quick().duration_s <= 180.0


def test_what_was_recorded_after_an_early_end_does_not_count(reference: GoodRuns) -> None:
    now = played(19)
    cut = now.part(0, 700)
    idle = {name: np.where(cut.t_s > cut.t_s[0] + 5.4, 0.0, v) for name, v in cut.inputs.items()}
    warm = cut.outputs["rtd_x_degC"] + np.where(cut.t_s > cut.t_s[0] + 5.4, 9.0, 0.0)
    ended = cut.with_columns(inputs=idle, outputs={"rtd_x_degC": warm})
    verdict = checked(PLANT, reference, [(ended, "short")])
    assert verdict.outcome == "quiet"


def forged(folder: Path, **changes: Any) -> None:
    """Replaces arrays of a stored baseline, and its sum in `baseline.json` as a forger would."""
    path = folder / "reference.npz"
    with np.load(path) as file:
        arrays = {name: file[name] for name in file.files} | changes
    np.savez_compressed(path, **arrays)
    about = json.loads((folder / "baseline.json").read_text())
    (folder / "baseline.json").write_text(json.dumps({**about, "arrays": ""}))


@pytest.mark.parametrize(
    ("name", "change"),
    [
        ("floor.sd", lambda a: np.where(a > 0, np.inf, a)),
        ("floor.sd", lambda a: -a),
        ("floor.sd", lambda a: a[:-1]),
        ("floor.rho", lambda a: a + 1.0),
        ("floor.gauge", lambda a: 0.0 * a),
        ("floor.day_sd", lambda a: a * np.nan),
        ("0.mean", lambda a: a[:-1]),
        ("0.mean", lambda a: a.astype("U8")),
        ("0.mean", lambda a: np.array([{}], dtype=object)),
        ("0.valid", lambda a: a.astype(float)),
        ("0.regime", lambda a: a + 1000),
        ("0.responses", lambda a: a[0]),
        ("0.changes", lambda a: a[:-1]),
        ("0.t_s", lambda a: a[::-1]),
        ("0.t_s", lambda a: np.float64(1.0)),
        ("0.base", lambda a: np.zeros((100_000_000,))),
    ],
)
def test_a_forged_array_of_a_baseline_is_refused_in_one_line(
    name: str, change: Any, stored: Path, tmp_path: Path
) -> None:
    shutil.copytree(stored, tmp_path, dirs_exist_ok=True)
    with np.load(tmp_path / "reference.npz") as file:
        was = file[name]
    forged(tmp_path, **{name: change(was)})
    with pytest.raises(BaselineError, match=r"reference\.npz cannot be read: .*commission again"):
        load(tmp_path, PLANT)


def test_arrays_that_claim_gigabytes_are_refused_before_they_are_unpacked(
    reference: GoodRuns, tmp_path: Path
) -> None:
    save(Baseline("bench", "digest", reference), PLANT, tmp_path)
    about = json.loads((tmp_path / "baseline.json").read_text())
    (tmp_path / "baseline.json").write_text(json.dumps({**about, "arrays": ""}))
    with zipfile.ZipFile(tmp_path / "reference.npz", "a") as packed:
        head = io.BytesIO()
        claim = {"descr": "<f8", "fortran_order": False, "shape": (10**9,)}
        np.lib.format.write_array_header_1_0(head, claim)
        packed.writestr("bomb.npy", head.getvalue())
    tracemalloc.start()
    try:
        with pytest.raises(BaselineError, match="more than 500000000 bytes"):
            load(tmp_path, PLANT)
        assert tracemalloc.get_traced_memory()[1] < 50_000_000
    finally:
        tracemalloc.stop()
