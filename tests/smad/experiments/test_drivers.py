"""Drivers: what a bench lacks is found first; logs and daemons give the same runs."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import msgspec
import numpy as np
import pytest

from sim_device.plant.models import Model
from smad.api import Fault, Motion
from smad.config import ControlConfig
from smad.control.commands import (
    DriveCurrent,
    Follow,
    HoldTemperature,
    MoveStage,
    Ramp,
    Tune,
)
from smad.control.plan import Do, Mark, Pause, Plan, UntilDone
from smad.experiments.campaign import CampaignBench, run_campaign, run_on
from smad.experiments.driver import PARTS, Mounting, log_name
from smad.experiments.errors import BenchLacksError, ExperimentError, StoppedError, TrippedError
from smad.experiments.live import LiveDriver
from smad.experiments.logs import LogDriver
from smad.experiments.registry import EXPERIMENTS, make_experiment
from smad.experiments.virtual import VirtualDriver
from smad.runlog.paths import part_path
from smad.runlog.reader import read_run

from .fake_client import FakeClient
from .helpers import NOMINAL, NoDriver, driver, given

PLAN = Plan(
    "short",
    (
        Do(Tune(kp_A_per_mm=10.0)),
        Mark("begin"),
        Do(Follow(trajectories=(Ramp(displacement_mm=2.0, rate_mm_per_s=1.0),))),
        UntilDone(10.0),
        Mark("moved"),
        Do(HoldTemperature(spring="x", temperature_degC=32.0, duration_s=0.5)),
        UntilDone(10.0),
        Do(DriveCurrent(pump_x_duty=1.0)),
        Pause(1.0),
        Mark("end"),
    ),
)


@pytest.mark.parametrize("name", EXPERIMENTS)
def test_each_part_an_experiment_needs_is_missed_by_name_before_anything_moves(name: str) -> None:
    experiment = make_experiment(name)
    for part in experiment.requirements():
        with pytest.raises(BenchLacksError) as refused:
            experiment.run(NoDriver(part), NOMINAL)
        assert PARTS[part] in str(refused.value)
        assert "nothing was moved" in str(refused.value)


@pytest.mark.parametrize(
    ("name", "settings", "mounting", "fits"),
    [
        ("fig4-stretch", {}, Mounting(), False),
        ("fig5-block", {}, Mounting("stretch"), False),
        ("fig11-tracking", {}, Mounting(), False),
        ("fig11-tracking", {"air": False}, Mounting(), True),
        ("fig12-frequency", {"air": False}, Mounting(cooling="air"), False),
        ("fig9-cycle", {}, Mounting(), True),
        ("dsc", {}, Mounting("blocked"), True),
    ],
)
def test_a_mounting_that_does_not_fit_is_refused_before_anything_moves(
    name: str, settings: dict[str, bool], mounting: Mounting, fits: bool
) -> None:
    experiment = make_experiment(name, settings)
    if fits:
        experiment.check(NoDriver(mounting=mounting))
    else:
        with pytest.raises(BenchLacksError, match="another mounting of the springs"):
            experiment.run(NoDriver(mounting=mounting), NOMINAL)


def test_draining_is_needed_only_where_it_is_tried() -> None:
    with pytest.raises(BenchLacksError, match="the drain valves"):
        make_experiment("fig12-frequency").check(NoDriver("drain"))
    make_experiment("fig12-frequency", {"beyond": False}).check(NoDriver("drain"))


def test_a_campaign_is_refused_whole_when_one_experiment_cannot_be_run() -> None:
    experiments = [make_experiment("resistance"), make_experiment("fig9-cycle")]
    bench = CampaignBench(Model(NOMINAL), lacking=frozenset({"force_N"}))
    with pytest.raises(BenchLacksError, match=r"fig9-cycle.*the force sensor"):
        run_campaign(experiments, bench)
    with pytest.raises(BenchLacksError, match="the force sensor"):
        run_on(experiments, NoDriver("force_N"), NOMINAL)


def test_a_virtual_run_repeats_to_the_bit_and_another_seed_differs() -> None:
    first, again = driver().run(PLAN), driver().run(PLAN)
    other = VirtualDriver(Model(NOMINAL), seed=4).run(PLAN)
    assert first.marks == again.marks
    for name in first.columns:
        assert np.array_equal(first[name], again[name], equal_nan=True)
    assert not np.array_equal(first["displacement_mm"], other["displacement_mm"])


def test_a_run_read_back_from_its_log_is_the_run(tmp_path: Path) -> None:
    run = driver(folder=tmp_path).run(PLAN)
    read = LogDriver([tmp_path / "short.mcap"]).run(PLAN)
    assert read.marks == pytest.approx(run.marks)
    for name in ("t_s", "displacement_mm", "rtd_x_degC", "force_N", "reference_mm"):
        assert np.allclose(read[name], run[name], equal_nan=True, rtol=1e-12)


def test_an_experiment_finds_the_same_in_its_log(tmp_path: Path) -> None:
    experiment = make_experiment("resistance")
    live = experiment.run(driver(given(), folder=tmp_path), NOMINAL)
    logged = experiment.run(LogDriver([tmp_path / "resistance.mcap"]), NOMINAL)
    assert logged.comparisons == live.comparisons
    assert logged.estimates == live.estimates


def test_a_log_of_another_run_is_not_taken_for_this_one(tmp_path: Path) -> None:
    driver(folder=tmp_path).run(PLAN)
    with pytest.raises(ExperimentError, match=r"none of the logs is of run.*fig9-cycle"):
        make_experiment("fig9-cycle").run(LogDriver([tmp_path / "short.mcap"]), NOMINAL)


def test_a_daemon_carries_out_the_same_plan_as_virtual_time(tmp_path: Path) -> None:
    client = FakeClient(tmp_path)
    live = LiveDriver(client, sleep=client.let_pass).run(PLAN)
    virtual = driver().run(PLAN)
    assert list(live.marks) == list(virtual.marks)
    for first, last in (("begin", "moved"), ("moved", "end")):
        here, there = live.between(first, last), virtual.between(first, last)
        assert here.t_s.size == pytest.approx(there.t_s.size, abs=15)
        assert here["displacement_mm"][-1] == pytest.approx(there["displacement_mm"][-1], abs=0.1)
    assert not client.recording


def test_a_spring_that_was_stretched_is_brought_back_before_the_next_run(tmp_path: Path) -> None:
    client = FakeClient(tmp_path, fixture="stretch")
    live = LiveDriver(client, fixture="stretch", sleep=client.let_pass)
    stretch = Plan(
        "stretch",
        (Mark("begin"), Do(MoveStage(stage_mm=40.0, rate_mm_per_s=10.0)), UntilDone(10.0)),
        fixture="stretch",
    )
    first, second = (live.run(stretch).between("begin", None) for _ in range(2))
    assert second["displacement_mm"][0] == pytest.approx(0.0, abs=0.2)
    for mm in (10.0, 20.0, 35.0):
        forces = [np.interp(mm, run["displacement_mm"], run["force_N"]) for run in (first, second)]
        assert forces[1] == pytest.approx(forces[0], abs=0.03)


def test_a_daemon_is_left_idle_and_tuned_as_it_was(tmp_path: Path) -> None:
    client = FakeClient(tmp_path)
    LiveDriver(client, sleep=client.let_pass).run(PLAN)
    assert client.motion().running == "idle"
    assert client.tunes[-1].kp_A_per_mm == ControlConfig().kp_A_per_mm


def test_a_run_that_fills_several_files_is_an_error_and_not_its_first_file(
    tmp_path: Path,
) -> None:
    client = FakeClient(tmp_path)
    part_path(tmp_path / f"1-{log_name(PLAN)}.mcap", 2).touch()
    with pytest.raises(ExperimentError, match="fills more than one file"):
        LiveDriver(client, sleep=client.let_pass).run(PLAN)


def test_a_fault_on_the_bench_ends_the_run_and_the_recording(tmp_path: Path) -> None:
    client = FakeClient(tmp_path, fails_at_s=1.5)
    with pytest.raises(ExperimentError, match="left ARMED"):
        LiveDriver(client, sleep=client.let_pass).run(PLAN)
    assert not client.recording


def test_a_trip_during_a_run_is_told_with_its_fault_and_the_log_is_kept(tmp_path: Path) -> None:
    client = FakeClient(tmp_path, fails_at_s=1.5)
    live = LiveDriver(client, sleep=client.let_pass)
    with pytest.raises(TrippedError, match=r"left ARMED; got FAULT, sensor_open"):
        live.run(PLAN)
    assert live.log is not None
    assert read_run(live.log).duration_s > 0.5


class Pressed(FakeClient):
    """A client whose bench somebody stops by its emergency stop."""

    def motion(self) -> Motion:
        motion = super().motion()
        fault = None if motion.fault is None else Fault(number=30, name="ESTOP_PRESSED")
        return msgspec.structs.replace(motion, fault=fault)


def test_an_emergency_stop_is_a_stop_by_somebody_and_not_a_fault_of_the_run(
    tmp_path: Path,
) -> None:
    client = Pressed(tmp_path, fails_at_s=1.5)
    live = LiveDriver(client, sleep=client.let_pass)
    with pytest.raises(StoppedError, match="left ARMED; got FAULT, ESTOP_PRESSED"):
        live.run(PLAN)
    assert live.log is not None


class Slow(FakeClient):
    """A client that learns of a trip by what it sends next."""

    def note(self, text: str) -> None:
        if text.endswith("late"):
            self.let_pass(3.0)
            self.require_no_stop()
        super().note(text)


def test_a_trip_that_comes_before_a_command_is_told_with_its_fault_too(tmp_path: Path) -> None:
    client = Slow(tmp_path, fails_at_s=1.5)
    plan = replace(PLAN, actions=(*PLAN.actions[:1], Mark("late"), *PLAN.actions[1:]))
    live = LiveDriver(client, sleep=client.let_pass)
    with pytest.raises(TrippedError, match=r"left ARMED; got FAULT, sensor_open"):
        live.run(plan)
    assert live.log is not None
    assert client.tunes[-1].kp_A_per_mm == ControlConfig().kp_A_per_mm


def test_a_run_whose_program_is_ended_is_no_example_of_anything(tmp_path: Path) -> None:
    client = FakeClient(tmp_path)

    def let_pass(seconds: float) -> None:
        client.let_pass(seconds)
        if client.recording:
            raise SystemExit(143)

    live = LiveDriver(client, sleep=let_pass)
    with pytest.raises(SystemExit):
        live.run(PLAN)
    assert live.log is not None
    assert read_run(live.log).cut_by == "the program was ended"


class Hangup(FakeClient):
    """A client whose program gets its second signal, as from a terminal that is closed, while it
    ends a run."""

    signals = 0

    def let_pass(self, seconds: float) -> None:
        super().let_pass(seconds)
        if self.recording and not self.signals:
            self.signals = 1
            raise SystemExit(129)

    def idle(self) -> None:
        if self.signals == 1:
            self.signals = 2
            raise SystemExit(129)
        super().idle()


def test_a_second_signal_while_a_run_is_ended_leaves_no_log_open(tmp_path: Path) -> None:
    client = Hangup(tmp_path)
    live = LiveDriver(client, sleep=client.let_pass)
    with pytest.raises(SystemExit):
        live.run(PLAN)
    assert client.signals == 2
    assert not client.recording
    assert live.log is not None
    assert read_run(live.log).cut_by == "the program was ended"


def test_springs_mounted_in_another_way_are_refused_before_anything_moves(tmp_path: Path) -> None:
    client = FakeClient(tmp_path)
    live = LiveDriver(client, sleep=client.let_pass)
    for plan in (
        Plan("a", PLAN.actions, fixture="stretch"),
        Plan("b", PLAN.actions, cooling="air"),
    ):
        with pytest.raises(BenchLacksError, match="mounted"):
            live.run(plan)
    assert not client.motion().armed


def test_a_wait_that_takes_too_long_on_a_daemon_is_an_error(tmp_path: Path) -> None:
    client = FakeClient(tmp_path)
    hold = Do(HoldTemperature(spring="x", temperature_degC=32.0))
    with pytest.raises(ExperimentError, match="did not end in time"):
        LiveDriver(client, sleep=client.let_pass).run(Plan("long", (hold, UntilDone(1.0))))


@pytest.mark.parametrize(("capabilities", "drains"), [(("drain",), True), ((), False)])
def test_a_bench_drains_only_if_its_board_says_it_has_the_valves(
    tmp_path: Path, capabilities: tuple[str, ...], drains: bool
) -> None:
    client = FakeClient(tmp_path, capabilities=capabilities)
    assert ("drain" in LiveDriver(client, sleep=client.let_pass).parts()) is drains
