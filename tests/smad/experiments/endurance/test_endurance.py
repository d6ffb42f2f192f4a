"""Endurance runs: cycles cut from columns, limits, room on the disk, thinned logs, a whole run."""

import csv
import shutil
from collections.abc import Callable
from pathlib import Path

import msgspec
import numpy as np
import pytest

from campaign.faults.smalldisk import small_disk
from sim_device.plant.models import built_in
from smad.cli import execute
from smad.config import Config, RecorderConfig
from smad.control.plan import Plan
from smad.errors import CommandError
from smad.experiments.driver import log_path
from smad.experiments.endurance.judgement import judgement_of
from smad.experiments.endurance.limits import SETTLING, WINDOW, EndLimits, LimitMonitor
from smad.experiments.endurance.profile import Profile
from smad.experiments.endurance.room import REST_S, Reserve, Room, longest_block_s, room_for
from smad.experiments.endurance.run import (
    CYCLES_FILE,
    BlockDriver,
    Endurance,
    EnduranceResult,
    Judgement,
    earlier_cycles,
    endure,
    take_over_killed,
)
from smad.experiments.endurance.statistics import Cycle, bounds, cycles_of
from smad.experiments.errors import ExperimentError
from smad.experiments.recording import Recording
from smad.experiments.virtual import VirtualDriver
from smad.health.cycles import rows_of_cycles
from smad.runlog.reader import read_run

PROFILE = Profile(low=-3.0, high=3.0, rate=2.0, dwell_s=0.5)
CYCLE = Cycle(
    number=1,
    t_s=0.0,
    duration_s=7.0,
    stroke_mm=6.0,
    force_max_N=2.0,
    resistance_ohm=0.8,
    transformation_degC=42.0,
    peak_degC=45.0,
    energy_J=80.0,
)
NO_ROOM = Room(0.0, 0.0, 0.0)


def columns(strokes_mm: list[float]) -> dict[str, np.ndarray]:
    """Triangles of these strokes at 100 Hz, 8 s each, and springs that follow."""
    t = np.arange(0, 8.0 * len(strokes_mm), 0.01)
    wave = 3.0 * (2.0 / np.pi) * np.arcsin(np.sin(2 * np.pi * t / 8.0))
    size = np.repeat(np.array(strokes_mm) / 6.0, 800)
    return {
        "t_s": t,
        "reference_mm": wave,
        "displacement_mm": wave * size,
        "force_N": np.full(len(t), 2.0),
        "i_meas_x_A": np.where(wave > 0, 1.0, 0.0),
        "v_x_V": np.where(wave > 0, 0.8, 0.0),
        "i_meas_y_A": np.where(wave > 0, 0.0, 0.5),
        "v_y_V": np.where(wave > 0, 0.0, 0.4),
        # With a hysteresis of 4 K.
        "rtd_x_degC": 40.0 + wave + 2.0 * np.sign(np.cos(2 * np.pi * t / 8.0)),
    }


def test_the_plan_of_a_block_takes_the_time_of_its_cycles() -> None:
    assert PROFILE.period_s == 7.0
    assert PROFILE.cycles_a_block(10_000, 3600.0) == 385
    assert PROFILE.cycles_a_block(20, 3600.0) == 20
    assert PROFILE.cycles_a_block(20, 3.0) == 1
    plan = PROFILE.plan(1, 120)
    assert [action.command.queue for action in plan.actions[:-1]] == [False, True, True]  # type: ignore[union-attr]


@pytest.mark.parametrize("wrong", [{"low": 3.0}, {"rate": 0.0}, {"dwell_s": -1.0}])
def test_a_profile_that_is_none_is_refused(wrong: dict[str, float]) -> None:
    with pytest.raises(ExperimentError):
        Profile(**{"low": -3.0, "high": 3.0, **wrong})  # type: ignore[arg-type]


def test_cycles_are_cut_where_the_reference_rises_and_have_their_stroke() -> None:
    found = list(cycles_of(columns([6.0, 5.0, 4.0, 4.0]), PROFILE, 11))
    assert [cycle.number for cycle in found] == [11, 12, 13]
    assert [round(cycle.stroke_mm, 1) for cycle in found] == [5.9, 4.9, 3.9]
    assert found[0].resistance_ohm == pytest.approx(0.8)
    assert found[0].energy_J == pytest.approx(0.8 * 4.0 + 0.2 * 4.0, rel=0.02)
    assert found[0].transformation_degC == pytest.approx(42.0, abs=0.3)


def test_readings_that_are_missing_are_no_error() -> None:
    bare = columns([6.0, 6.0])
    bare["force_N"] = np.full(len(bare["t_s"]), np.nan)
    bare["displacement_mm"] = np.full(len(bare["t_s"]), np.nan)
    (cycle,) = cycles_of(bare, PROFILE, 1)
    assert np.isnan([cycle.force_max_N, cycle.stroke_mm, cycle.transformation_degC]).all()


def reached(limits: EndLimits, change: Callable[[int], dict[str, float]]) -> tuple[int, str]:
    watch = LimitMonitor(limits)
    for number in range(1, 2000):
        cycle = msgspec.structs.replace(CYCLE, number=number, **change(number))
        if reason := watch.add(cycle):
            return number, reason
    return 0, ""


def test_a_pair_that_does_not_move_loses_no_stroke() -> None:
    limits = EndLimits(stroke_lost_percent=10.0)
    assert reached(limits, lambda n: {"stroke_mm": 0.0}) == (0, "")


@pytest.mark.parametrize(
    ("limits", "change", "words"),
    [
        (EndLimits(stroke_lost_percent=10.0), lambda n: {"stroke_mm": 6.0 - 0.001 * n}, "stroke"),
        (
            EndLimits(resistance_up_percent=10.0),
            lambda n: {"resistance_ohm": 0.8 * (1 + 1e-4 * n)},
            "resistance",
        ),
        (EndLimits(shift_K=3.0), lambda n: {"transformation_degC": 42.0 - 0.01 * n}, "shifted"),
        (EndLimits(shift_K=3.0), lambda n: {"transformation_degC": 42.0 + 0.01 * n}, "shifted"),
    ],
)
def test_a_limit_ends_the_run_when_the_median_reaches_it(
    limits: EndLimits, change: Callable[[int], dict[str, float]], words: str
) -> None:
    number, reason = reached(limits, change)
    assert words in reason
    assert 300 < number < 1100
    assert reached(EndLimits(), change) == (0, "")


def test_one_odd_cycle_ends_nothing_and_the_settling_ones_are_no_reference() -> None:
    odd = {SETTLING + WINDOW + 5: 1.0}
    assert reached(
        EndLimits(stroke_lost_percent=10.0), lambda n: {"stroke_mm": odd.get(n, 6.0)}
    ) == (0, "")
    settling = reached(
        EndLimits(stroke_lost_percent=10.0), lambda n: {"stroke_mm": 8.0 if n <= SETTLING else 6.0}
    )
    assert settling == (0, "")


def test_the_room_of_a_week_is_that_of_its_cycles_and_thinned_by_the_factor() -> None:
    whole = room_for(PROFILE, 86_400, 1, 500, 100.0)
    thinned = room_for(PROFILE, 86_400, 100, 500, 100.0)
    rests = 173 * REST_S * 100 * 200
    assert whole.logs == pytest.approx(86_400 * 7.0 * 100 * 200 + rests)
    assert thinned.logs == pytest.approx(864 * 7.0 * 100 * 200 + rests)
    assert thinned.block > 0.0
    assert "MB of run logs" in thinned.in_words()


@pytest.mark.parametrize(
    ("recorder", "longest_s"),
    [({}, 3600.0), ({"max_file_min": 5.0}, 300.0), ({"max_file_MB": 10.0}, 500.0)],
)
def test_a_block_fits_one_file_of_the_run_log(recorder: dict[str, float], longest_s: float) -> None:
    assert longest_block_s(Config(recorder=RecorderConfig(**recorder))) == longest_s


def test_a_folder_of_run_logs_that_cannot_be_written_is_told_before(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("no folder")
    with pytest.raises(CommandError, match="where the run logs go"):
        Reserve(tmp_path / "file" / "runs", Room(2e6, 0.0, 0.0))


def test_room_is_reserved_for_a_folder_that_the_daemon_has_not_made_yet(tmp_path: Path) -> None:
    Reserve(tmp_path / "runs", Room(400e3, 0.0, 0.0)).close()
    assert list(tmp_path.iterdir()) == []


def test_too_little_room_is_told_before_anything_moves(tmp_path: Path) -> None:
    with small_disk(tmp_path / "disk") as disk:
        if disk.refused:
            pytest.skip(disk.refused)
        with pytest.raises(CommandError, match=r"allowed: 2 MB: 2\.0 MB of run logs"):
            Reserve(disk.folder, Room(2e6, 0.0, 0.0))
        free = shutil.disk_usage(disk.folder).free
        reserve = Reserve(disk.folder, Room(400e3, 0.0, 0.0))
        assert free - shutil.disk_usage(disk.folder).free >= 400_000
        reserve.use(0.5)
        assert 200_000 <= free - shutil.disk_usage(disk.folder).free < 300_000
        assert list(disk.folder.iterdir()) == []
        reserve.close()
        assert shutil.disk_usage(disk.folder).free == free


class Virtual:
    """A simulated bench that ages."""

    def __init__(self, folder: Path, **effects: dict[str, float]) -> None:
        self.folder = folder
        self.log: Path | None = None
        self.driver = VirtualDriver(built_in("A").with_effects(effects), folder=folder)

    def run(self, plan: Plan) -> Recording:
        self.log = log_path(self.folder, plan)
        return self.driver.run(plan)


def carried_out(folder: Path, bench: BlockDriver, **asked: object) -> EnduranceResult:
    return endure(Endurance(profile=PROFILE, **asked), bench, folder, NO_ROOM)  # type: ignore[arg-type]


class AfterWeeks:
    """A bench whose board has run for two weeks."""

    log = None

    def run(self, plan: Plan) -> Recording:
        recorded = columns([6.0] * 25)
        return Recording({**recorded, "t_s": recorded["t_s"] + 1_209_600.0}, {})


def test_a_block_after_weeks_of_board_time_is_one_row_of_health(tmp_path: Path) -> None:
    carried_out(tmp_path, AfterWeeks(), cycles=24)
    (row,) = rows_of_cycles(tmp_path, set())
    assert row.cycles == 24.0


def test_a_run_in_virtual_time_has_all_its_cycles_and_keeps_every_third_in_full(
    tmp_path: Path,
) -> None:
    bench = Virtual(tmp_path)
    ended = carried_out(tmp_path, bench, cycles=6, full_every=3)
    assert (ended.cycles, ended.reason) == (6, "all cycles were done")
    rows = list(csv.DictReader((tmp_path / CYCLES_FILE).open()))
    assert [row["number"] for row in rows] == ["1", "2", "3", "4", "5", "6"]
    (log,) = tmp_path.glob("*.mcap")
    run = read_run(log)
    kept = list(cycles_of({k: np.asarray(c, float) for k, c in run.columns.items()}, PROFILE, 1))
    assert 1200 < len(run) < 1500
    assert kept[0].stroke_mm == pytest.approx(float(rows[0]["stroke_mm"]), abs=0.01)
    assert not run.cut_short
    assert any("one cycle in 3" in note for note in run.header.notes)
    assert earlier_cycles(tmp_path) == 6
    with (tmp_path / CYCLES_FILE).open("a") as file:
        file.write("7,1.0,7.")
    assert earlier_cycles(tmp_path) == 6
    carried_out(tmp_path, bench, cycles=1, first=7)
    assert [row["number"] for row in csv.DictReader((tmp_path / CYCLES_FILE).open())][-2:] == [
        "6",
        "7",
    ]


def test_a_spring_that_ages_fast_is_ended_by_its_limit(tmp_path: Path) -> None:
    bench = Virtual(tmp_path, transformation_fatigue={"shift_K": 2.0, "shrink": 0.0})
    ended = carried_out(tmp_path, bench, cycles=40, limits=EndLimits(stroke_lost_percent=20.0))
    assert "the stroke has lost" in ended.reason
    assert bench.driver.cycles[0] > 5.0


def test_check_ups_come_when_they_are_due_and_a_changed_place_ends_the_run(tmp_path: Path) -> None:
    asked: list[int] = []

    def check(number: int) -> Judgement:
        asked.append(number)
        return Judgement("the film of X", 0.9 if number >= 4 else 0.1)

    ended = endure(
        Endurance(
            profile=PROFILE, cycles=20, check_every=2, limits=EndLimits(place_probability=0.8)
        ),
        Virtual(tmp_path),
        tmp_path,
        NO_ROOM,
        check=check,
    )
    assert asked == [2, 4]
    assert "probability 0.90 at cycle 4" in ended.reason


def test_a_failing_block_keeps_what_was_written(tmp_path: Path) -> None:
    bench = Virtual(tmp_path)
    whole = bench.run

    def second_fails(plan: Plan) -> Recording:
        if plan.name != "endurance-0000001":
            raise ExperimentError("stopped")
        return whole(plan)

    bench.run = second_fails  # type: ignore[method-assign]
    with pytest.raises(ExperimentError, match="stopped"):
        endure(
            Endurance(profile=PROFILE, cycles=6, check_every=2),
            bench,
            tmp_path,
            NO_ROOM,
            check=lambda number: Judgement("", 0.0),
        )
    assert earlier_cycles(tmp_path) == 2


def test_of_a_block_that_was_ended_early_the_whole_cycles_count(tmp_path: Path) -> None:
    bench = Virtual(tmp_path)
    played = bench.run

    def stopped_after_three(plan: Plan) -> Recording:
        played(PROFILE.plan(1, 4))
        raise ExperimentError("stopped")

    bench.run = stopped_after_three  # type: ignore[method-assign]
    with pytest.raises(ExperimentError, match="stopped"):
        carried_out(tmp_path, bench, cycles=20)
    assert earlier_cycles(tmp_path) == 3


def test_cycles_of_a_killed_block_are_taken_over_from_its_recovered_log(tmp_path: Path) -> None:
    bench = Virtual(tmp_path)
    bench.run(PROFILE.plan(1, 4))
    assert bench.log is not None
    bench.log.replace(tmp_path / "20261126-010101-endurance-0000001.recovered.mcap")
    (tmp_path / "20261126-010101-endurance-0000001.mcap").write_bytes(b"cut")
    assert take_over_killed(tmp_path, PROFILE, tmp_path, 1) == 3
    assert take_over_killed(tmp_path, PROFILE, tmp_path, 4) == 0
    assert earlier_cycles(tmp_path) == 3


def test_check_ups_without_their_baseline_are_refused_before_anything_moves(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["--cycles", "4", "--every", "2", "checkup", "--baseline", str(tmp_path / "gone")]
    assert execute(["run", "endurance", "--sim", *words, "--folder", str(tmp_path / "e")]) == 1
    assert "there is no baseline in" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


def test_a_verdict_gives_headline_and_probability_that_something_has_come() -> None:
    quiet = b'{"outcome": "quiet", "headline": "h", "question": "x"}'
    assert judgement_of(quiet) == Judgement("h", 0.0)
    told = b"""{"outcome": "causes", "headline": "h", "causes": [{"rivals": [
        {"kind": "effect", "probability": 0.5}, {"kind": "law", "probability": 0.25},
        {"kind": "nothing", "probability": 0.25}]}]}"""
    assert judgement_of(told) == Judgement("h", 0.75)
    bare = b'{"outcome": "causes", "headline": "h", "causes": [{}]}'
    assert judgement_of(bare) == Judgement("h", 1.0)


def test_temperatures_are_cycled_by_the_temperature_loop() -> None:
    plan = Profile(quantity="temperature", low=30.0, high=50.0, rate=1.0, dwell_s=2.0).plan(1, 2)
    goals = [a.command.temperature_degC for a in plan.actions[::2]]  # type: ignore[union-attr]
    assert goals == [50.0, 30.0, 50.0, 30.0]


def test_a_reference_that_never_rises_has_no_cycles() -> None:
    assert bounds(np.full(100, np.nan), PROFILE) == []
