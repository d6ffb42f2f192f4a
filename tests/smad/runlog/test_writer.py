"""Recording: nothing raises, nothing waits, nothing is overwritten, nothing is lost unseen."""

import errno
import os
import shutil
import signal
import subprocess
import sys
import textwrap
import time
from collections.abc import Callable
from datetime import datetime, timedelta
from pathlib import Path

import numpy as np
import pytest
from mcap.reader import NonSeekingReader, make_reader

from smad.errors import RunLogError
from smad.runlog.mcap_file import McapFile
from smad.runlog.overview import list_runs
from smad.runlog.paths import free_path, new_run_path, newest_run
from smad.runlog.reader import read_run
from smad.runlog.recover import recover
from smad.runlog.schema import ROW_TOPIC, Event, Row
from smad.runlog.writer import RunWriter, write_run

from .helpers import HEADER, row_numbers, rows, write_small_run

NEVER_S = 3600.0


def test_what_is_appended_is_read_back(tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    with RunWriter(path, HEADER, flush_interval_s=0.01) as writer:
        assert all(writer.append(row) for row in rows(500))
    run = read_run(path)
    assert writer.error is None
    assert (writer.dropped, run.dropped, run.cut_short, run.notes) == (0, 0, False, [])
    assert row_numbers(run.columns) == list(range(500))
    assert run.header == HEADER


def test_the_mcap_package_reads_the_file_from_its_index_and_without(tmp_path: Path) -> None:
    path = write_small_run(tmp_path / "run.mcap")
    with path.open("rb") as file:
        reader = make_reader(file, validate_crcs=True)
        summary = reader.get_summary()
        assert summary is not None
        assert summary.statistics is not None
        assert summary.statistics.message_count == 1003
        assert all(channel.schema_id != 0 for channel in summary.channels.values())
        indexed = [message.data for _, _, message in reader.iter_messages(topics=[ROW_TOPIC])]
    with path.open("rb") as file:
        front_to_back = [
            message.data
            for _, channel, message in NonSeekingReader(file, validate_crcs=True).iter_messages()
            if channel.topic == ROW_TOPIC
        ]
    assert len(indexed) == 1000
    assert indexed == front_to_back


def times_ns(path: Path) -> list[int]:
    with path.open("rb") as file:
        found = []
        for _, _, message in make_reader(file).iter_messages(topics=[ROW_TOPIC]):
            assert message.log_time == message.publish_time
            found.append(message.log_time)
    return found


def test_times_in_the_log_are_board_time_from_the_first_host_time_on(tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    write_run(path, HEADER, rows(10, start=300))
    times = times_ns(path)
    assert times[0] == pytest.approx(1.790000003e18, abs=1000)
    assert set(np.diff(times)) == {10_000_000}


def test_a_host_clock_that_is_set_in_mid_run_does_not_bend_the_log(tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    write_run(
        path,
        HEADER,
        [Row(t_s=n / 100, host_time_s=1.79e9 + (86_400 if n > 5 else 0)) for n in range(10)],
    )
    assert set(np.diff(times_ns(path))) == {10_000_000}


def test_a_board_that_restarts_does_not_lay_its_samples_over_earlier_ones(tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    clock = [(5.0, 100.0), (5.1, 100.1), (0.0, 103.0), (0.1, 103.1), (0.0, 90.0), (0.1, 90.1)]
    records = [Row(t_s=board, host_time_s=host) for board, host in clock]
    write_run(path, HEADER, [*records[:3], Event(t_s=0.0, kind="note", text="back"), *records[3:]])
    assert [ns * 1e-9 for ns in times_ns(path)] == pytest.approx(
        [100.0, 100.1, 103.0, 103.1, 103.1, 103.2]
    )


def test_rows_without_host_time_start_where_the_header_says(tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    write_run(path, HEADER, [Row(t_s=5.0), Row(t_s=5.5)])
    assert times_ns(path) == [1_790_000_000_000_000_000, 1_790_000_000_500_000_000]


def test_a_full_queue_drops_rows_counts_them_and_says_so_in_the_log(tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    with RunWriter(path, HEADER, flush_interval_s=NEVER_S, queue_rows=10) as writer:
        taken = [writer.append(row) for row in rows(15)]
    run = read_run(path)
    assert taken == [True] * 10 + [False] * 5
    assert writer.dropped == run.dropped == 5
    assert row_numbers(run.columns) == list(range(10))
    assert [(event.kind, event.data) for event in run.events] == [("record", {"dropped": 5})]
    assert "5 rows dropped while recording" in run.notes


def test_a_record_that_cannot_be_written_is_left_out_and_told(tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    with RunWriter(path, HEADER, flush_interval_s=NEVER_S) as writer:
        assert not writer.append(Event(kind="note", text="x", data={"bad": object()}))
        assert writer.append(Row(t_s=1.0))
    assert writer.error is None
    run = read_run(path)
    assert len(run) == 1
    assert run.dropped == 1
    (told,) = run.events
    assert (told.kind, told.data) == ("record", {"dropped": 1})
    assert told.text.startswith("1 record dropped, not writable: ")
    assert "object" in told.text


def test_numbers_of_numpy_are_numbers(tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    with RunWriter(path, HEADER) as writer:
        assert writer.append(Row(t_s=np.float64(1.5), force_N=np.float32(0.5), mode=np.int64(3)))
    run = read_run(path)
    assert (run.columns["t_s"][0], run.columns["force_N"][0], run.columns["mode"][0]) == (
        1.5,
        0.5,
        3,
    )


def test_a_long_run_goes_on_in_further_files(tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    with RunWriter(path, HEADER, flush_interval_s=NEVER_S, max_file_s=3.0) as writer:
        for row in rows(1000):
            writer.append(row)
    runs = [read_run(part) for part in writer.paths]
    assert [part.name for part in writer.paths][:2] == ["run.mcap", "run.part2.mcap"]
    assert [run.header.part for run in runs] == list(range(1, len(runs) + 1))
    assert len(runs) > 1
    assert [n for run in runs for n in row_numbers(run.columns)] == list(range(1000))
    assert not any(run.cut_short for run in runs)


@pytest.mark.parametrize("jump_s", [-86_400.0, 86_400.0])
def test_parts_are_as_long_as_the_board_says_when_somebody_sets_the_clock(
    tmp_path: Path, jump_s: float
) -> None:
    with RunWriter(
        tmp_path / "run.mcap", HEADER, flush_interval_s=NEVER_S, max_file_s=3.0
    ) as writer:
        for n, row in enumerate(rows(1000)):
            if n % 200 == 0:
                writer.append(Event(host_time_s=1.79e9 + jump_s, kind="link", text="lost"))
            writer.append(row)
    lasting_s = [read_run(part).duration_s for part in writer.paths]
    assert all(3.0 <= s < 3.0 + 2.56 for s in lasting_s[:-1])
    assert len(lasting_s) > 1


def test_a_log_that_is_being_written_is_not_called_cut(tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    with RunWriter(path, HEADER, flush_interval_s=0.001) as writer:
        for row in rows(10):
            writer.append(row)
        while not writer.written:
            time.sleep(0.001)
        run = read_run(path)
        assert (len(run), run.being_written, run.cut_short) == (10, True, False)
        assert run.notes == ["still being written; what is shown here is what it holds so far"]
        assert [run.problem for run in list_runs(tmp_path)] == ["being written"]
        with pytest.raises(RunLogError, match=r"still being written.*smad record stop"):
            recover(path)
    run = read_run(path)
    assert (len(run), run.being_written, run.cut_short, run.notes) == (10, False, False, [])
    assert [run.problem for run in list_runs(tmp_path)] == [""]


def test_a_log_is_never_overwritten(tmp_path: Path) -> None:
    path = write_small_run(tmp_path / "run.mcap")
    before = path.read_bytes()
    with pytest.raises(RunLogError, match="is there already"):
        RunWriter(path, HEADER)
    with pytest.raises(RunLogError, match="is there already"):
        write_run(path, HEADER, rows(1))
    assert path.read_bytes() == before


def test_a_run_that_breaks_off_while_being_written_at_once_leaves_nothing(tmp_path: Path) -> None:
    def broken():
        yield from rows(3)
        raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        write_run(tmp_path / "run.mcap", HEADER, broken())
    assert list(tmp_path.iterdir()) == []


def test_a_disk_that_turned_read_only_is_told_as_a_log_that_cannot_be_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def read_only(*_: object, **__: object) -> None:
        raise OSError(errno.EROFS, os.strerror(errno.EROFS))

    monkeypatch.setattr(McapFile, "finish", read_only)
    monkeypatch.setattr(Path, "unlink", read_only)
    with pytest.raises(RunLogError, match="cannot write"):
        write_run(tmp_path / "run.mcap", HEADER, rows(3))


def test_a_folder_that_cannot_be_written_is_refused_before_the_run(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(RunLogError, match="cannot create"):
        RunWriter(tmp_path / "file" / "run.mcap", HEADER)


def test_names_of_files_tell_date_and_name_and_are_never_taken_twice(tmp_path: Path) -> None:
    when = datetime(2026, 11, 20, 5, 7, 9)
    first = new_run_path(tmp_path, "step ±10 mm/slow", when)
    assert first.name == "20261120-050709-step-10-mm-slow.mcap"
    first.touch()
    assert free_path(first) == first.with_name(f"{first.stem}-2.mcap")
    assert new_run_path(tmp_path / "other", "///", when).name == "20261120-050709-run.mcap"


def test_the_name_of_a_file_keeps_letters_of_any_alphabet_as_far_as_disks_take_it(
    tmp_path: Path,
) -> None:
    when = datetime(2026, 11, 20, 5, 7, 9)
    for name, shown in (("Ka\u0308se lauf ü", "Käse-lauf-ü"), ("温度" * 50, "温度" * 10)):
        path = new_run_path(tmp_path, name, when)
        assert path.name == f"20261120-050709-{shown}.mcap"
    RunWriter(path, HEADER).close()
    assert read_run(path).header.name == HEADER.name


@pytest.mark.parametrize("back", [timedelta(), timedelta(seconds=3), timedelta(hours=1)])
def test_the_last_log_by_name_is_the_last_made_though_the_clock_went_back(
    tmp_path: Path, back: timedelta
) -> None:
    when = datetime(2026, 10, 25, 2, 59, 59)
    (tmp_path / "20380119-031407-clock-of-the-future.mcap").touch()
    made = []
    for then, name in ((when, "run"), (when - back, "b"), (when - back, "a"), (when, "c")):
        made.append(new_run_path(tmp_path, name, then))
        made[-1].touch()
    assert sorted(tmp_path.glob("2026*")) == made
    assert made[1].name == "20261025-030000-b.mcap"


def test_the_newest_run_is_the_last_by_name(tmp_path: Path) -> None:
    with pytest.raises(RunLogError, match="no run logs in"):
        newest_run(tmp_path)
    for name in ("20261120-050709-b.mcap", "20261121-000000-a.mcap", "20260101-000000-z.mcap"):
        (tmp_path / name).touch()
    (tmp_path / "imported.mcap").touch()
    assert newest_run(tmp_path) == tmp_path / "20261121-000000-a.mcap"
    assert Path(list_runs(tmp_path, 1)[0].path) == newest_run(tmp_path)


FULL_DISK = """
    import resource, signal, sys
    from smad.runlog.writer import RunWriter
    from tests.smad.runlog.helpers import HEADER, rows

    signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (40_000, 40_000))
    writer = RunWriter(sys.argv[1], HEADER, flush_interval_s=0.001)
    for row in rows(200_000):
        if not writer.append(row) and writer.error:
            break
    writer.close()
    print(writer.written, writer.dropped > 0, writer.error)
"""

ENDLESS = """
    import sys, time
    from smad.runlog.writer import RunWriter
    from tests.smad.runlog.helpers import HEADER, rows

    with RunWriter(sys.argv[1], HEADER, flush_interval_s=0.02) as writer:
        for row in rows(10_000_000):
            writer.append(row)
            time.sleep(0.001)
"""


def script(text: str, path: Path) -> list[str]:
    root = Path(__file__).resolve().parents[3]
    body = f"import sys; sys.path.insert(0, {str(root)!r})\n" + textwrap.dedent(text)
    return [sys.executable, "-c", body, str(path)]


def test_a_full_disk_stops_the_recording_not_the_caller(tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    done = subprocess.run(script(FULL_DISK, path), capture_output=True, text=True, check=True)
    written, dropped, error = done.stdout.strip().split(" ", 2)
    assert "rows are no longer recorded" in error
    assert dropped == "True"
    run = read_run(path)
    assert row_numbers(run.columns) == list(range(int(written)))
    assert int(written) > 0


def _deleted(path: Path) -> None:
    shutil.rmtree(path.parent)


def _moved(path: Path) -> None:
    path.rename(path.with_name("elsewhere"))


def _replaced(path: Path) -> None:
    path.unlink()
    path.write_bytes(b"")


@pytest.mark.parametrize("lose", [_deleted, _moved, _replaced])
def test_a_log_whose_file_is_gone_ends_the_recording_and_says_so(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, lose: Callable[[Path], None]
) -> None:
    monkeypatch.setattr("smad.runlog.writer._LOOK_S", 0.0)
    path = tmp_path / "runs" / "run.mcap"
    with RunWriter(path, HEADER, flush_interval_s=0.01) as writer:
        lose(path)
        deadline = time.monotonic() + 60
        while writer.error is None and time.monotonic() < deadline:
            time.sleep(0.01)
        assert writer.error == (
            f"cannot write {path}: it was deleted, moved or replaced; rows are no longer recorded"
        )
        assert not writer.append(next(iter(rows(1))))
    assert writer.dropped == 1


def test_a_log_that_is_lost_just_before_its_end_is_told_too(tmp_path: Path) -> None:
    path = tmp_path / "runs" / "run.mcap"
    with RunWriter(path, HEADER, flush_interval_s=60.0) as writer:
        _deleted(path)
    assert writer.error is not None
    assert "deleted, moved or replaced" in writer.error


def test_a_writer_that_is_killed_leaves_every_flushed_row(tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    writing = subprocess.Popen(script(ENDLESS, path))
    try:
        deadline = time.monotonic() + 60
        flushed = 0
        while flushed < 100 and time.monotonic() < deadline:
            assert writing.poll() is None
            time.sleep(0.02)
            if path.exists() and path.stat().st_size > 20_000:
                flushed = len(read_run(path))
        writing.send_signal(signal.SIGKILL)
    finally:
        writing.kill()
        writing.wait()
    run = read_run(path)
    assert len(run) >= flushed >= 100
    assert run.cut_short
    assert row_numbers(run.columns) == list(range(len(run)))
    assert run.header == HEADER
