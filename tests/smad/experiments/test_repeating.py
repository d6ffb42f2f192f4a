"""Recorded runs played again: what can be, what is refused, and that the inputs are the same."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pytest

from smad.config import Config, ControlConfig, LimitsConfig, LinkConfig
from smad.control.commands import Follow, FollowInputs, Step
from smad.control.pieces import rows_in_pieces
from smad.control.plan import Do, Plan, UntilDone
from smad.experiments.driver import log_path
from smad.experiments.errors import EndedEarlyError, ExperimentError
from smad.experiments.repeating import RepeatError, read_recorded_inputs, recorded_inputs_of
from smad.experiments.replayer import RestFirstDriver
from smad.experiments.rest import Start
from smad.runlog.reader import Run, read_run

from .fake_client import FakeClient
from .helpers import driver

CLOSED_LOOP = Plan(
    "moved",
    (Do(Follow(trajectories=(Step(displacement_mm=3.0, duration_s=3.0),))), UntilDone(9.0)),
)
INPUTS = ("i_applied_x_A", "i_applied_y_A", "duty_x", "duty_y")


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The log of a closed-loop run."""
    folder = tmp_path_factory.mktemp("recorded")
    driver(folder=folder).run(CLOSED_LOOP)
    return log_path(folder, CLOSED_LOOP)


def changed(path: Path, **columns: Any) -> Run:
    run = read_run(path)
    return replace(run, columns={**run.columns, **columns})


def test_a_closed_loop_run_is_repeated_sample_by_sample(recorded: Path, tmp_path: Path) -> None:
    repeat = read_recorded_inputs(recorded)
    repeat.require_fit(Config())
    again = repeat.plan("again")
    driver(folder=tmp_path).run(again)
    log = read_run(log_path(tmp_path, again))
    assert log.header.repeats == repeat.source
    assert recorded.name in repeat.source
    then, now = read_run(recorded).columns, log.columns
    n = len(then["t_s"])
    for name in INPUTS:
        # The repeat begins a sample later: what its first sample shows was set before.
        assert np.array_equal(now[name][1:n], then[name][: n - 1]), name
    assert np.abs(now["displacement_mm"][1:n] - then["displacement_mm"][: n - 1]).max() < 0.05


@pytest.mark.parametrize(
    ("config", "said"),
    [
        (Config(link=LinkConfig(rate_hz=250)), "another rate.*100 Hz.*250 Hz"),
        (
            Config(control=ControlConfig(current_limit_A=1.0)),
            "in spring X is above the host's limit",
        ),
        (
            Config(limits=LimitsConfig(displacement_max_mm=2.0)),
            "exceeds a limit of this bench: .*displacement_mm",
        ),
        (
            Config(limits=LimitsConfig(temperature_max_degC=30.0)),
            "exceeds a limit of this bench: .*rtd_x_degC",
        ),
    ],
)
def test_a_run_that_does_not_fit_the_bench_is_refused_before_anything_moves(
    recorded: Path, config: Config, said: str
) -> None:
    with pytest.raises(RepeatError, match=said):
        read_recorded_inputs(recorded).require_fit(config)


def test_a_run_of_another_board_or_of_none_is_refused(recorded: Path) -> None:
    repeat = read_recorded_inputs(recorded)
    for mine in ("", "c0ffee"):
        with pytest.raises(RepeatError, match=r"another bench.*--other-bench"):
            replace(repeat, uid=mine).require_bench("abcdef", "bench")
    with pytest.raises(RepeatError, match="another bench"):
        replace(repeat, uid="abcdef", bench="left").require_bench("abcdef", "bench")
    replace(repeat, uid="abcdef").require_bench("abcdef", "bench")


def test_a_log_that_does_not_say_what_was_applied_is_refused(recorded: Path) -> None:
    run = read_run(recorded)
    holes = np.array(run.columns["duty_y"], float)
    holes[100] = np.nan
    jumps = np.array(run.columns["t_s"], float)
    jumps[150:] += 0.5
    back = np.array(run.columns["t_s"], float)
    back[150:] -= 0.5
    never = np.zeros(len(run), dtype=np.int64)
    for columns, said in (
        ({"duty_y": holes}, "does not say what was applied.*duty_y at 1"),
        ({"t_s": jumps}, "lacks samples"),
        ({"t_s": back}, "lacks samples"),
        ({"mode": never}, "its board was never armed"),
    ):
        with pytest.raises(RepeatError, match=said):
            recorded_inputs_of(changed(recorded, **columns), "x")


def test_only_the_stretch_in_which_the_board_was_armed_is_repeated(recorded: Path) -> None:
    run = read_run(recorded)
    mode = np.array(run.columns["mode"])
    armed = int(mode[10])
    mode[:] = armed
    mode[200:] = 0
    repeat = recorded_inputs_of(changed(recorded, mode=mode), "x")
    assert repeat.armed_s == pytest.approx(1.99)
    assert repeat.whole_s > 2.9


def test_a_bench_that_answers_otherwise_ends_the_repeat_and_keeps_the_log(
    recorded: Path, tmp_path: Path
) -> None:
    client = FakeClient(tmp_path)
    live = RestFirstDriver(client, sleep=client.let_pass)
    repeat = read_recorded_inputs(recorded)
    far = tuple(20.0 for _ in repeat.command.t_s)
    other = replace(repeat, command=msgspec.structs.replace(repeat.command, displacement_mm=far))
    with pytest.raises(EndedEarlyError, match=r"displacement is .* instead of 20"):
        live.run(other.plan("other"))
    assert client.motion().running == "idle"
    assert live.log is not None
    assert 0.4 < read_run(live.log).duration_s < 1.5


def test_a_repeat_that_ends_before_all_of_it_is_sent_is_told_as_ended(
    recorded: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("smad.control.pieces.LONGEST_INPUTS", 100)

    class Slow(FakeClient):
        """Sends the inputs in pieces, one each second."""

        def follow_inputs(self, command: FollowInputs) -> None:
            for piece in rows_in_pieces(command):
                super().follow_inputs(piece)
                self.let_pass(1.0)

    client = Slow(tmp_path)
    repeat = read_recorded_inputs(recorded)
    far = tuple(20.0 for _ in repeat.command.t_s)
    other = replace(repeat, command=msgspec.structs.replace(repeat.command, displacement_mm=far))
    with pytest.raises(EndedEarlyError, match=r"displacement is .* instead of 20"):
        RestFirstDriver(client, sleep=client.let_pass).run(other.plan("other"))


def test_a_rest_that_the_bench_does_not_come_to_is_told_and_nothing_is_played(
    tmp_path: Path,
) -> None:
    client = FakeClient(tmp_path)
    live = RestFirstDriver(client, sleep=client.let_pass)
    live.start = Start(5.0, (0.0, 0.0))
    with pytest.raises(ExperimentError, match=r"does not return to the state.*instead of 5\.00"):
        live.run(CLOSED_LOOP)
    assert live.log is None
