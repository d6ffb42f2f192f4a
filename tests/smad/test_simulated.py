"""`with smad.simulated() as bench:` is a bench that is gone when the block ends."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager
from functools import partial
from pathlib import Path

import psutil
import pytest

import smad
from smad.control.commands import Step
from smad.errors import DaemonError, PortError
from smad.processes.simulated import simulated, simulated_axes
from smad.processes.simulator import simulated_bench


def daemons() -> list[int]:
    """Processes of daemons that this one has started."""
    children = psutil.Process().children(recursive=True)
    return [p.pid for p in children if "start" in p.cmdline()]


def test_a_simulated_bench_is_commanded_by_its_client_and_gone_after_the_block(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    with smad.simulated() as bench:
        assert len(daemons()) >= 1
        with bench.armed():
            # However long a notebook thinks, it keeps the bench.
            assert not bench.status().control.holder
            bench.move(Step(displacement_mm=1.0, duration_s=2.0))
            now = bench.wait_until_done()
        assert now.displacement_mm == pytest.approx(1.0, abs=0.3)
    assert daemons() == []


@pytest.mark.parametrize("begin", [simulated, partial(simulated_axes, 2)])
def test_a_program_that_is_killed_leaves_no_simulated_bench_behind(
    monkeypatch: pytest.MonkeyPatch, begin: Callable[[], AbstractContextManager[object]]
) -> None:
    def run(arguments: Sequence[str], folder: Path) -> None:
        parent = arguments.index("--parent")
        raise DaemonError(f"it ends with process {arguments[parent + 1]}")

    monkeypatch.setattr("smad.processes.simulated.running_daemon", run)
    with pytest.raises(DaemonError, match=f"it ends with process {os.getpid()}"), begin():
        pass


def test_a_port_that_goes_because_the_bench_ended_is_explained_by_the_bench(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    bench = tmp_path / "bench"
    bench.write_text("#!/bin/sh\necho ready: it\necho smad: the plant melted >&2\nexit 70\n")
    bench.chmod(0o755)
    monkeypatch.setattr("sys.executable", str(bench))
    with (
        pytest.raises(DaemonError, match="simulated bench ended: the plant melted"),
        simulated_bench([], tmp_path / "tty", waiting=lambda _: None),
    ):
        raise PortError("there is no such port")


def test_a_bench_that_ends_without_a_word_did_not_stall(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("sys.executable", "/bin/true")
    with (
        pytest.raises(DaemonError, match="did not start: it ended without a word"),
        simulated_bench([], tmp_path / "tty", waiting=lambda _: None),
    ):
        pass


def test_what_interrupts_the_block_ends_the_bench_as_well() -> None:
    def interrupted() -> None:
        with smad.simulated() as bench:
            assert bench.status() is not None
            raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        interrupted()
    assert daemons() == []


@pytest.mark.parametrize("speed", [0.0, -1.0, 1e6, float("nan")])
def test_a_speed_that_cannot_be_is_refused(speed: float) -> None:
    with pytest.raises(DaemonError, match="cannot run at this speed"), smad.simulated(speed=speed):
        pass


def test_a_bench_that_does_not_come_up_says_why() -> None:
    with (
        pytest.raises(DaemonError, match="did not start"),
        smad.simulated(options=("--effect", "no_such_effect")),
    ):
        pass
