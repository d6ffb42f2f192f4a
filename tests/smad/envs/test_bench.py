"""A policy of an environment on a bench."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from campaign.virtual import Refused
from smad.api import Control
from smad.client import NotInControl
from smad.control.commands import DriveCurrent
from smad.diagnosis.spring_pair import read_gap_run
from smad.envs import on_bench
from smad.envs.bench import Answering
from smad.envs.errors import ActionRefused, PolicyFailed
from smad.envs.signals import NAMES
from smad.runlog.schema import Row
from tests.smad.daemon.rig import rig_in
from tests.smad.experiments.fake_client import FakeClient

AT = {name: i for i, name in enumerate(NAMES)}


class BenchClient(FakeClient):
    """The client over a simulated bench in this process, with the rest of what a policy needs."""

    def __init__(self, folder: Path) -> None:
        super().__init__(folder)
        self.disarmed = self.released = False
        self.taken = 0

    def take_control(self, name: str, lease_s: float = 10.0) -> Control:
        self.taken += 1
        return Control(holder=name)

    @contextlib.contextmanager
    def in_control(self, name: str, lease_s: float, *, renewed: bool) -> Iterator[None]:
        assert not renewed, "a policy may think for ever"
        self.take_control(name, lease_s)
        try:
            yield
        finally:
            self.released = True

    @contextlib.contextmanager
    def armed(self) -> Iterator[None]:
        self.arm()
        try:
            yield
        finally:
            self.disarmed = True

    def telemetry(self) -> Iterator[Row]:
        while True:
            self.let_pass(0.01)
            row = self.status().sample
            assert row is not None
            yield row


def proportional(seen: np.ndarray) -> np.ndarray:
    error = seen[AT["reference_mm"]] - seen[AT["displacement_mm"]]
    cool = float(np.clip(error, -1.0, 1.0))
    return np.array([np.clip(error, -1.0, 1.0), max(-cool, 0.0), max(cool, 0.0)])


def test_a_policy_follows_the_reference_on_a_bench_and_leaves_a_run_for_the_diagnosis(
    tmp_path: Path,
) -> None:
    bench = BenchClient(tmp_path)
    run = on_bench(
        proportional, client=bench, action="demand", duration_s=20.0, seed=3, name="policy"
    )
    still = float(np.sqrt(np.mean(run.reference_mm**2)))
    assert run.rms_mm < 0.7 * still
    assert bench.disarmed
    assert bench.released
    recorded = read_gap_run(Path(run.path))
    assert len(recorded.t_s) > 1900
    assert max(float(np.nanmax(v)) for k, v in recorded.inputs.items() if k.startswith("i_")) > 1.0


def test_what_the_policy_sees_is_what_the_environment_shows() -> None:
    seen = []

    def policy(observation: np.ndarray) -> np.ndarray:
        seen.append(observation)
        return np.zeros(4)

    answering = Answering(policy, reference=lambda rng, t_s: t_s, duration_s=5.0)
    row = Row(t_s=100.0, host_time_s=0.0, displacement_mm=1.5, rtd_x_degC=40.0, force_N=2.0)
    answering.answer(row)
    later = Row(t_s=102.0, host_time_s=0.0, displacement_mm=None, rtd_x_degC=41.0)
    answering.answer(later)
    assert seen[0].dtype == np.float32
    assert seen[0][AT["displacement_mm"]] == np.float32(1.5)
    assert seen[1][AT["displacement_mm"]] == np.float32(1.5)
    assert seen[1][AT["rtd_x_degC"]] == np.float32(41.0)
    assert seen[1][AT["reference_mm"]] == pytest.approx(2.0)
    assert seen[1][AT["reference_ahead_mm"]] == pytest.approx(2.5)
    assert answering.answer(Row(t_s=105.0, host_time_s=0.0)) is None


@pytest.mark.parametrize(
    ("policy", "error", "said"),
    [
        (lambda seen: np.array([np.nan, 0.0, 0.0, 0.0]), ActionRefused, "i_x_A"),
        (lambda seen: np.array([9.0, 0.0, 0.0, 0.0]), ActionRefused, "i_x_A"),
        (lambda seen: 1 / 0, PolicyFailed, "ZeroDivisionError"),
        (lambda seen: "left", PolicyFailed, "ValueError"),
    ],
)
def test_a_policy_that_gives_no_action_ends_with_the_bench_disarmed(
    tmp_path: Path, policy: object, error: type[Exception], said: str
) -> None:
    bench = BenchClient(tmp_path)
    with pytest.raises(error, match=said) as refused:
        on_bench(policy, client=bench, duration_s=1.0)  # type: ignore[arg-type]
    assert "\n" not in str(refused.value)
    assert bench.disarmed
    assert not bench.recording


def test_the_currents_of_a_policy_that_fails_end_before_its_log_is_closed(tmp_path: Path) -> None:
    bench = BenchClient(tmp_path)
    answers = iter([np.array([1.0, 0.0, 0.0, 0.0])])
    close, ran = bench.stop_recording, []

    def closing() -> object:
        ran.append(bench.motion().running)
        return close()

    bench.stop_recording = closing  # type: ignore[assignment,method-assign]
    with pytest.raises(PolicyFailed):
        on_bench(lambda seen: next(answers), client=bench, duration_s=1.0)  # type: ignore[arg-type]
    assert ran == ["idle"]


def test_samples_that_came_while_a_policy_was_late_are_left_out(tmp_path: Path) -> None:
    bench = BenchClient(tmp_path)
    asked = 0
    now = iter(np.cumsum([0.0, 0.5] * 40))

    def count() -> Iterator[Row]:
        nonlocal asked
        asked += 1
        return BenchClient.telemetry(bench)

    bench.telemetry = count  # type: ignore[method-assign]
    run = on_bench(
        lambda seen: np.zeros(4), client=bench, duration_s=0.2, clock=lambda: float(next(now))
    )
    assert run.late == asked - 1 == len(run.t_s)


def test_a_run_whose_lease_lapsed_over_its_last_thought_ends_with_the_refusal(
    tmp_path: Path,
) -> None:
    bench = BenchClient(tmp_path)
    given: list[DriveCurrent] = []

    def current(command: DriveCurrent) -> None:
        given.append(command)
        if len(given) > 1:
            raise NotInControl("control has ended", value="", action="take it again")

    def thinking(seen: np.ndarray) -> np.ndarray:
        bench.let_pass(1.0)
        return np.array([1.0, 0.0, 0.0, 0.0])

    bench.current = current  # type: ignore[assignment,method-assign]
    with pytest.raises(NotInControl):
        on_bench(thinking, client=bench, duration_s=0.5)
    assert given[-1].i_x_A == 0.0
    assert bench.disarmed
    assert not bench.recording
    assert bench.taken == 2


async def test_while_a_policy_is_late_the_last_currents_stay_and_then_its_lease_lapses(
    tmp_path: Path,
) -> None:
    answering = Answering(lambda seen: np.array([1.0, 0.0, 0.0, 0.0]), duration_s=60.0)
    async with rig_in(tmp_path) as rig:
        await rig.run_for(2.0)
        control = await rig.ask("control.take", name="policy", lease_s=2.0)
        members = {"lease": control["lease"]}
        await rig.ask("arm", members=members)
        command = answering.answer(Row(t_s=0.0, host_time_s=0.0))
        assert command is not None
        await rig.ask("current", members=members, i_x_A=command.i_x_A, i_y_A=command.i_y_A)
        await rig.run_for(1.0)
        assert rig.bench.board.outputs.applied_mA[0] == 1000
        await rig.run_for(2.5)
        assert rig.bench.board.outputs.applied_mA[0] == 0
        with pytest.raises(Refused, match=r"arm|control|disarm"):
            await rig.ask("current", members=members, i_x_A=1.0)
