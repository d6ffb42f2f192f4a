"""The process campaign: two of its faults, whole, and that its table fits the daemon."""

import gc
import importlib
import signal
import tempfile
from pathlib import Path

import pytest

from campaign.faults.breakable_daemon import DAEMON_PARTS
from campaign.faults.oracle import judge
from campaign.faults.process import HOST_FAULTS, run_host_fault
from campaign.faults.rig import FaultRig, rig_in
from campaign.faults.smalldisk import small_disk
from campaign.faults.trace import HOT
from campaign.rig import PATIENCE_S
from firmware_protocol.enums import BoardState
from smad.client import Refused
from smad.errors import SmadError
from smad.runlog.reader import read_run

KILLED_AFTER_MS = (0, 60, 400)
"""While it arms, on a quick machine."""
KILLED_LATER_MS = (1600, 6400, 25600)
"""On a slow one, until one was killed that had armed."""


def test_a_daemon_killed_while_armed_leaves_a_safe_bench_and_a_readable_log() -> None:
    outcome = run_host_fault(HOST_FAULTS["sigkill"], seed=1)
    assert judge(outcome) == []
    assert outcome.first_fault == "SETPOINT_LOST"
    assert outcome.log is not None
    assert outcome.log.rows >= outcome.log.flushed > 0


def test_a_daemon_whose_controller_dies_disarms_and_says_so() -> None:
    outcome = run_host_fault(HOST_FAULTS["dies_controller"], seed=1)
    assert judge(outcome) == []
    assert outcome.ending is not None
    assert "the control task died (RuntimeError: injected)" in outcome.ending.line


@pytest.mark.parametrize("name", ["stop_against_arm", "lapsed_takeover"])
def test_a_real_daemon_that_was_stopped_is_not_armed_again(name: str) -> None:
    outcome = run_host_fault(HOST_FAULTS[name], seed=1)
    assert judge(outcome) == []


@pytest.mark.parametrize("name", ["killed_program", "stopped_program"])
def test_a_program_that_is_killed_or_stopped_leaves_a_bench_that_stays_disarmed(name: str) -> None:
    try:
        outcome = run_host_fault(HOST_FAULTS[name], seed=1)
    except SmadError as error:
        # On a starved machine the bench stopped by itself before the fault: that was no trial.
        if "until 4 A flow" not in str(error):
            raise
        outcome = run_host_fault(HOST_FAULTS[name], seed=1)
    assert judge(outcome) == []
    assert outcome.safe_after_s is not None


def off_s(rig: FaultRig) -> float:
    """Board time of the last change of the board's state."""
    return rig.bench.trace.changes[-1][0] * 1e-6


def has_heated(rig: FaultRig) -> bool:
    """Whether the board was ever in a state in which current may flow."""
    return any(state in HOT for _, state, _ in rig.bench.trace.changes)


def test_a_program_that_is_killed_while_it_arms_leaves_nothing_armed_after_its_lease() -> None:
    with (
        tempfile.TemporaryDirectory(prefix="smad-arming-") as folder,
        rig_in(Path(folder), 1) as rig,
    ):
        watcher = rig.ready()
        for after_ms in (*KILLED_AFTER_MS, *KILLED_LATER_MS):
            if after_ms in KILLED_LATER_MS and has_heated(rig):
                break
            rig.wait("it can be armed", lambda: rig.bench.board.state is BoardState.SAFE)
            assert rig.program("dies_arming", str(after_ms)).wait(PATIENCE_S) == -signal.SIGKILL
            rig.wait("the lease is over", lambda: not watcher.status().control.holder)
            rig.wait("it is off", lambda: rig.bench.board.state not in HOT)
            # The daemon knows it with the next sample.
            rig.wait("a sample since", lambda: watcher.motion().board_time_s > off_s(rig))
            assert not watcher.motion().armed
        # Else no program was killed late enough to be missed.
        assert has_heated(rig)


def test_what_was_left_before_a_bench_is_not_looked_through_beside_it() -> None:
    left = [[n] for n in range(1000)]
    with tempfile.TemporaryDirectory(prefix="smad-rig-") as folder, rig_in(Path(folder), 1):
        looked_through = {id(each) for each in gc.get_objects()}
        assert not any(id(each) in looked_through for each in left)


def test_every_part_that_is_to_break_exists() -> None:
    for place in DAEMON_PARTS.values():
        module, _, path = place.partition(":")
        owner, _, method = path.partition(".")
        assert callable(getattr(getattr(importlib.import_module(module), owner), method))


def test_a_disk_that_is_full_ends_the_recording_and_nothing_else() -> None:
    outcome = run_host_fault(HOST_FAULTS["disk_full"], seed=1, paced=True)
    assert judge(outcome) == []
    assert outcome.first_fault == ""
    assert outcome.log is not None
    assert outcome.log.rows >= outcome.log.flushed > 0
    # Where mounting is refused, a limit on file size stands in and says so.
    assert "file system is full" in outcome.injected or "mounting is refused" in outcome.injected


def test_without_a_descriptor_left_the_bench_goes_on_and_a_new_client_stops_it() -> None:
    outcome = run_host_fault(HOST_FAULTS["exhausted_descriptors"], seed=1)
    assert judge(outcome) == []
    assert outcome.safe_after_s is not None
    assert outcome.log is not None
    assert outcome.log.rows >= outcome.log.flushed > 0


def test_a_deleted_folder_ends_the_recording_tells_and_nothing_else() -> None:
    outcome = run_host_fault(HOST_FAULTS["deleted_folder"], seed=1, paced=True)
    assert judge(outcome) == []
    assert outcome.first_fault == ""


def test_a_bench_with_a_full_disk_is_not_armed_without_a_log_and_records_again_with_room(
    tmp_path: Path,
) -> None:
    with small_disk(tmp_path / "disk") as disk:
        if disk.refused:
            pytest.skip(disk.refused)
        with (
            tempfile.TemporaryDirectory(prefix="smad-disk-") as folder,
            rig_in(Path(folder), 1, disk=disk, paced=True) as rig,
        ):
            client = rig.heat()
            disk.fill(rig.daemon.process.pid, disk.folder)
            rig.wait("recording failed", lambda: bool(client.status().recorder.error))
            assert client.motion().armed
            assert client.motion().running == "current"
            # The log that arming began ends by itself soon after disarming.
            client.stop_recording()
            client.disarm()
            with pytest.raises(Refused, match="No space left on device; free some space"):
                client.start_recording("again")
            disk.empty()
            path = Path(client.start_recording("again").path)
            rows = client.status().recorder.rows
            rig.wait("rows", lambda: client.status().recorder.rows > rows + 20)
            client.stop_recording()
            assert len(read_run(path)) > 20
