"""One runner to a queue, also while the item of one that was killed has not ended."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from smad.cli import execute
from smad.queue import QueueError
from smad.queue.lease import ORPHAN_PATIENCE_S, RunnerLease
from smad.queue.meter import Meter
from smad.queue.process import LONGEST_OUTPUT, ItemProcess
from smad.runlog.schema import Row


def test_of_two_runners_the_second_is_refused_and_told_which_is_the_first(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    first = RunnerLease(tmp_path)
    first.acquire()
    assert RunnerLease(tmp_path).runs()
    assert execute(["queue", "run", "--folder", str(tmp_path)]) == 1
    assert f"has a runner already; got process {os.getpid()}" in capsys.readouterr().err
    first.release()
    assert not RunnerLease(tmp_path).runs()
    RunnerLease(tmp_path).acquire()


def test_an_orphan_that_has_the_lock_keeps_a_new_runner_waiting(tmp_path: Path) -> None:
    first = RunnerLease(tmp_path)
    first.acquire()
    orphan = subprocess.Popen(["sleep", "1000"], pass_fds=(first.descriptor,))
    gone = subprocess.Popen(["true"])
    gone.wait()
    first.path.write_text(f"{gone.pid}\n")
    first.release()
    now_s = 0.0

    def sleep(seconds: float) -> None:
        nonlocal now_s
        now_s += seconds
        if now_s > ORPHAN_PATIENCE_S / 2 and dies:
            orphan.kill()
            orphan.wait()

    dies = False
    with pytest.raises(QueueError, match="an item of a runner that was killed has not ended"):
        RunnerLease(tmp_path).acquire(sleep=sleep, clock_s=lambda: now_s)
    dies, now_s = True, 0.0
    second = RunnerLease(tmp_path)
    second.acquire(sleep=sleep, clock_s=lambda: now_s)
    assert second.process() == os.getpid()


def process(folder: Path, code: str) -> ItemProcess:
    return ItemProcess(
        [sys.executable, "-c", code],
        folder=folder,
        output=folder / "queue" / "item.txt",
        environment={},
        descriptor=-1,
    )


def test_an_item_that_floods_fills_no_disk_and_its_last_line_is_known(tmp_path: Path) -> None:
    flood = process(tmp_path, f"print('x' * {LONGEST_OUTPUT * 2}); print('smad: the end')")
    flood._process.wait()
    assert flood.last_line() == "the end"
    assert (tmp_path / "queue" / "item.txt").stat().st_size <= LONGEST_OUTPUT + 500


def test_a_kill_ends_what_an_item_began_too(tmp_path: Path) -> None:
    item = process(tmp_path, "import subprocess; subprocess.run(['sleep', '1000'])")
    item.kill()
    assert item._process.wait() == -9
    # Its output ends with the last process that has it.
    item._reader.join()


def test_energy_and_cycles_are_those_of_the_samples() -> None:
    meter = Meter()
    for n in range(1001):
        place_mm = 4.0 * abs((n / 100) % 2 - 1) + 0.1 * (n % 2)
        meter.sample(
            Row(t_s=0.01 * n, i_meas_x_A=2.0, v_x_V=1.5, i_meas_y_A=1.0, displacement_mm=place_mm)
        )
    usage = meter.take_usage()
    assert usage.energy_J == pytest.approx(10.0 * (3.0 + 1.0), rel=1e-3)
    assert usage.cycles == 5.0
    assert meter.take_usage().energy_J == 0.0


def test_a_gap_between_samples_is_not_integrated() -> None:
    meter = Meter()
    meter.sample(Row(t_s=0.0, i_meas_x_A=2.0, v_x_V=1.0))
    meter.sample(Row(t_s=100.0, i_meas_x_A=2.0, v_x_V=1.0))
    assert meter.take_usage().energy_J == 0.0
