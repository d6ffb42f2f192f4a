"""The last minute is in memory, armed or not, and is written when something stopped the bench."""

from __future__ import annotations

import asyncio
import errno
import os
import threading
from collections.abc import Callable
from pathlib import Path

import pytest

from campaign.virtual import Refused
from firmware_protocol.enums import BoardState
from sim_device.faults import injection
from smad.daemon.services import Clocks
from smad.daemon.telemetry import blackbox
from smad.daemon.telemetry.blackbox import ENTRY_BYTES, FOLDER, BlackBox
from smad.runlog.header import RunHeader
from smad.runlog.reader import read_axes, read_run
from smad.runlog.schema import Row
from tests.smad.daemon.axes import NAMES, axes_in, lines
from tests.smad.daemon.rig import Rig, rig_in
from tests.smad.daemon.test_axes import armed, silent_for


def written(folder: Path) -> list[Path]:
    return sorted((folder / "runs" / FOLDER).glob("*.mcap"))


async def until_written(rig: Rig, folder: Path, count: int = 1) -> list[Path]:
    for _ in range(400):
        await silent_for(rig, 0.05)
        if rig.daemon.black_box.path and len(written(folder)) >= count:
            return written(folder)
    raise AssertionError("nothing was written")


@pytest.mark.parametrize("fault", ["sensor_open", "reboot", "unplug"])
async def test_a_board_that_dies_leaves_the_minute_before_it(tmp_path: Path, fault: str) -> None:
    boards = lines(faults={"yaw-1": [injection(fault, 4.0)]})
    async with axes_in(tmp_path, boards) as rig:
        await armed(rig)
        await rig.run_for(1.6)
        (path,) = await until_written(rig, tmp_path)
        assert (await rig.ask("status"))["recorder"]["last"] == str(path)
        assert f"in {path}" in rig.said
    runs = read_axes(path)
    assert tuple(runs) == NAMES
    assert all(len(run) > 200 for run in runs.values())
    assert any("yaw-1" in event.text for event in runs["yaw-1"].events)


async def test_a_stop_by_somebody_else_is_kept_and_ones_own_is_not(tmp_path: Path) -> None:
    async with rig_in(tmp_path) as rig:
        await rig.arm()
        await rig.ask("disarm")
        await silent_for(rig, 3.5)
        assert written(tmp_path) == []
        assert rig.axis.watch.mode is BoardState.SAFE
        await rig.ask("arm")
        await rig.ask("disarm", client=b"other")
        (path,) = await until_written(rig, tmp_path)
        # What a plot of the run marks is what happened to the bench, not where a file is.
        assert [e.kind for e in rig.daemon.journal.recent if str(path) in e.text] == ["record"]


@pytest.mark.parametrize("leap_s", [-3600.0, 3600.0])
async def test_a_wall_clock_that_is_set_neither_delays_nor_empties_it(
    tmp_path: Path, leap_s: float
) -> None:
    async with rig_in(tmp_path) as rig:
        await rig.arm()
        await rig.run_for(3.0)
        await rig.ask("disarm", client=b"other")
        rig.jump_wall_clock(leap_s)
        (path,) = await until_written(rig, tmp_path)
        assert len(read_run(path)) > 300
        assert len(rig.daemon.black_box._blocks) < 20


async def test_the_last_seconds_are_written_when_asked_for_also_at_rest(tmp_path: Path) -> None:
    async with rig_in(tmp_path) as rig:
        await rig.run_for(3.0)
        status = await rig.ask("record.last", seconds=2.0)
        assert not status["recording"]
        assert 190 <= len(read_run(status["last"])) <= 210
        with pytest.raises(Refused, match="so much is not kept"):
            await rig.ask("record.last", seconds=100.0)


async def test_what_is_kept_is_bounded_in_time_and_bytes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    async with rig_in(tmp_path) as rig:
        box = rig.daemon.black_box
        box.keep_s = 1.0
        await rig.run_for(3.0)
        assert 90 <= sum(len(block.entries) for block in box._blocks) <= 130
        monkeypatch.setattr(blackbox, "MOST_BYTES", 20_000)
        await rig.run_for(0.5)
        assert box._bytes <= 20_000
        data = [entry for block in box._blocks for entry in block.entries]
        assert box._bytes == sum(len(one) + ENTRY_BYTES for one in data)


def _no_header(_: str) -> RunHeader:
    raise AssertionError("nothing is written")


def test_a_minute_of_six_axes_at_500_hz_fits(tmp_path: Path) -> None:
    now_s = 1_700_000_000.0
    box = BlackBox(60.0, tmp_path, _no_header, Clocks(lambda: round(now_s * 1e6)), print)
    # Every number there is, none of them short.
    row = Row(**dict.fromkeys(Row.__struct_fields__, 1.0 / 3.0))
    for _ in range(62 * 500):
        now_s += 0.002
        for axis in range(6):
            box.row(row, f"axis-{axis}", now_s)
    assert box._blocks[-1].last_s - box._blocks[0].began_s >= 60.0
    assert box._bytes <= blackbox.MOST_BYTES
    box.close()


async def test_repeated_writings_hold_no_more_threads_or_blocks(tmp_path: Path) -> None:
    async with rig_in(tmp_path) as rig:
        await rig.run_for(1.0)
        await rig.ask("record.last", seconds=1.0)
        threads = threading.active_count()
        for _ in range(5):
            await rig.ask("record.last", seconds=1.0)
        assert threading.active_count() == threads
        assert len(rig.daemon.black_box._blocks) <= 1 + rig.now_us() / 1e6 / (60.0 / 128)


def _no_folder(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (folder / "runs").write_text("a file where the folder should be")


def _failing_disk(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def failing(self: Path, pattern: str) -> None:
        raise OSError(errno.EIO, os.strerror(errno.EIO))

    monkeypatch.setattr(Path, "glob", failing)


@pytest.mark.parametrize(
    ("broken", "why"),
    [(_no_folder, "cannot create folder"), (_failing_disk, "Input/output error")],
)
async def test_a_disk_that_takes_nothing_is_told_and_the_bench_goes_on(
    broken: Callable[[Path, pytest.MonkeyPatch], None],
    why: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    broken(tmp_path, monkeypatch)
    async with rig_in(tmp_path) as rig:
        await rig.arm()
        with pytest.raises(Refused, match=why) as refused:
            await rig.ask("record.last")
        assert refused.value.reason == "recorder"
        await rig.ask("disarm", client=b"other")
        while "could not be written" not in rig.said:
            await silent_for(rig, 0.1)
            await asyncio.sleep(0)
