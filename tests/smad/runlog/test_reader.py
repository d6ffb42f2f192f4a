"""Reading back: whole logs, cut logs, damaged logs, and files that are no logs."""

import functools
import tempfile
from io import FileIO
from pathlib import Path

import msgspec
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mcap.reader import make_reader
from mcap.writer import CompressionType, Writer

from smad.config import RecorderConfig
from smad.errors import RunLogError
from smad.runlog import reader
from smad.runlog.bounds import FASTEST_HZ, MOST_LOG_ROWS
from smad.runlog.mcap_file import McapFile, pack
from smad.runlog.overview import list_runs
from smad.runlog.reader import read_run
from smad.runlog.recover import recover, recovered_path
from smad.runlog.schema import EVENT_TOPIC, ROW_TOPIC, TOPICS, Event, Row, json_schema
from smad.runlog.summary import summarise
from smad.runlog.writer import write_run

from .helpers import HEADER, row_numbers, rows, write_small_run

ROWS = 1000


@functools.cache
def whole_log() -> bytes:
    with tempfile.TemporaryDirectory() as folder:
        return write_small_run(Path(folder) / "run.mcap", ROWS).read_bytes()


@functools.cache
def chunks() -> list[tuple[int, int, int]]:
    """Start, end and number of rows of each chunk, as the mcap package sees them."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "run.mcap"
        path.write_bytes(whole_log())
        with path.open("rb") as file:
            reader = make_reader(file)
            summary = reader.get_summary()
            assert summary is not None
            times = [m.log_time for _, _, m in reader.iter_messages(topics=[ROW_TOPIC])]
    found = []
    left = len(times)
    for index in summary.chunk_indexes:
        count = min(256, left)
        left -= count
        end = index.chunk_start_offset + index.chunk_length
        found.append((index.chunk_start_offset, end, count))
    return found


def test_a_whole_log_gives_columns_events_link_and_header(tmp_path: Path) -> None:
    run = read_run(write_small_run(tmp_path / "run.mcap"))
    assert not run.cut_short
    assert run.notes == []
    assert run.header == HEADER
    assert len(run) == ROWS
    assert run.duration_s == pytest.approx((ROWS - 1) / 100)
    assert [event.text for event in run.events] == ["armed", "too hot"]
    assert run.events[1].data == {"channel": "rtd_x", "value": 90.5}
    assert run.link[0].counters == {"crc_errors": 3.0}
    numbers = np.arange(ROWS)
    np.testing.assert_array_equal(run.columns["i_cmd_x_A"], numbers / 1000)
    np.testing.assert_array_equal(
        run.columns["displacement_mm"], np.where(numbers % 3 == 0, np.nan, numbers / 1000)
    )
    np.testing.assert_array_equal(np.isnan(run.columns["force_N"]), numbers % 5 == 0)
    np.testing.assert_array_equal(run.columns["faults"], np.where(numbers % 2, 0, 0x80000001))


def test_channels_without_any_value_are_listed(tmp_path: Path) -> None:
    run = read_run(write_small_run(tmp_path / "run.mcap"))
    assert "stage_mm" in run.missing
    assert "valid" in run.missing
    assert "displacement_mm" not in run.missing
    assert (run.columns["valid"] == -1).all()
    assert np.isnan(run.columns["stage_mm"]).all()


def cuts() -> list[int]:
    edges = [at for start, end, _ in chunks() for at in (start, start + 1, end - 1, end, end + 1)]
    return sorted({*range(0, len(whole_log()), 397), *edges})


def test_a_log_cut_anywhere_gives_every_whole_chunk_before_the_cut(tmp_path: Path) -> None:
    path = tmp_path / "cut.mcap"
    data = whole_log()
    refused = 0
    for at in cuts():
        path.write_bytes(data[:at])
        whole = sum(count for _, end, count in chunks() if end <= at)
        try:
            run = read_run(path)
        except RunLogError:
            refused += 1
            assert at <= chunks()[0][0], "a log with a chunk can be read"
            continue
        assert row_numbers(run.columns) == list(range(whole)), f"cut at byte {at}"
        assert run.cut_short or whole == ROWS
        assert run.notes
    assert 0 < refused < len(cuts())


def test_a_log_whose_end_was_never_written_but_allocated_is_read(tmp_path: Path) -> None:
    path = tmp_path / "zeros.mcap"
    at = chunks()[1][1]
    path.write_bytes(whole_log()[:at] + bytes(5000))
    run = read_run(path)
    assert row_numbers(run.columns) == list(range(512))
    assert run.cut_short


def test_a_damaged_chunk_is_skipped_and_its_rows_are_counted(tmp_path: Path) -> None:
    path = tmp_path / "damaged.mcap"
    data = bytearray(whole_log())
    start, end, count = chunks()[1]
    data[(start + end) // 2] ^= 0xFF
    path.write_bytes(data)
    run = read_run(path)
    assert row_numbers(run.columns) == [*range(256), *range(512, ROWS)]
    assert run.damaged == count == 256
    assert any("damaged" in note for note in run.notes)


@pytest.mark.parametrize("compression", list(CompressionType))
@pytest.mark.parametrize("chunked", [True, False])
def test_logs_that_other_programs_wrote_anew_are_read(
    tmp_path: Path, compression: CompressionType, chunked: bool
) -> None:
    path = tmp_path / "anew.mcap"
    with path.open("wb") as file:
        writer = Writer(file, compression=compression, use_chunking=chunked)
        writer.start()
        writer.add_metadata("smad", HEADER.to_metadata())
        channels = {}
        for topic, record in ((ROW_TOPIC, Row), (EVENT_TOPIC, Event), ("/other", Row)):
            schema = writer.register_schema(topic, "jsonschema", json_schema(record))
            channels[topic] = writer.register_channel(topic, "json", schema)
        for number, row in enumerate(rows(50)):
            body = msgspec.json.encode(row)
            writer.add_message(channels[ROW_TOPIC], number, body, number)
            writer.add_message(channels["/other"], number, b"not ours", number)
        writer.finish()
    run = read_run(path)
    assert row_numbers(run.columns) == list(range(50))
    assert run.header == HEADER
    assert run.notes == []


def test_messages_that_do_not_follow_the_schema_are_left_out_and_counted(tmp_path: Path) -> None:
    path = tmp_path / "odd.mcap"
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start()
        schema = writer.register_schema("row", "jsonschema", json_schema(Row))
        channel = writer.register_channel(ROW_TOPIC, "json", schema)
        bodies = [b'{"t_s":1,"later":2}', b"{", b'{"t_s":null}', b'{"t_s":2,"mode":1e99}', b"\xff"]
        for body in [*bodies, b'{"t_s":3,"mode":99999999999999999999999}', b'{"t_s":4},{"t_s":5}']:
            writer.add_message(channel, 0, body, 0)
        writer.finish()
    run = read_run(path)
    assert run.columns["t_s"].tolist() == [1.0, 3.0]
    assert run.columns["mode"].tolist() == [-1, -1]
    assert "5 messages left out: not of the schema" in run.notes
    assert "the header is missing" in run.notes


def test_a_board_that_restarted_is_noted(tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    write_run(path, HEADER, [*rows(5, start=100), *rows(5)])
    assert any("restarted" in note for note in read_run(path).notes)


@pytest.mark.parametrize("content", [b"", b"hello", b"t_s,x_mm\n1,2\n", bytes(100)])
def test_a_file_that_is_no_log_is_refused_in_one_line(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "no.mcap"
    path.write_bytes(content)
    with pytest.raises(RunLogError, match="is not a run log") as caught:
        read_run(path)
    assert len(str(caught.value).splitlines()) == 1


def test_a_log_that_was_copied_as_text_is_refused_with_what_to_do(tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    write_small_run(path)
    path.write_bytes(path.read_bytes().replace(b"\n", b"\r\n"))
    with pytest.raises(RunLogError, match="copy it again in binary mode"):
        read_run(path)


def test_an_mcap_file_of_another_program_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "other.mcap"
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start()
        writer.finish()
    with pytest.raises(RunLogError, match="no channel /smad/row"):
        read_run(path)


def test_a_file_that_is_not_there_is_refused(tmp_path: Path) -> None:
    with pytest.raises(RunLogError, match="cannot read"):
        read_run(tmp_path / "nothing.mcap")
    with pytest.raises(RunLogError, match="cannot read"):
        read_run(tmp_path)


@pytest.mark.parametrize("before", [0, 300, -40])
@pytest.mark.parametrize("number", [0, 1, 2])
def test_a_sector_that_is_lost_costs_two_chunks_and_not_the_rest(
    tmp_path: Path, number: int, before: int
) -> None:
    path = tmp_path / "damaged.mcap"
    data = bytearray(whole_log())
    at = chunks()[number][1] - before
    data[at - 12 : at + 500] = bytes(k * 37 % 256 for k in range(512))
    path.write_bytes(data)
    whole = set(row_numbers(read_run(path).columns))
    first = sum(count for *_, count in chunks()[:number])
    lost = sum(count for *_, count in chunks()[number : number + 2])
    assert whole >= set(range(ROWS)) - set(range(first, first + lost))


@pytest.mark.parametrize("cut", [0.5, 0.9, 0.999])
def test_a_recovered_log_is_whole_and_holds_what_was_readable(tmp_path: Path, cut: float) -> None:
    data = whole_log()
    path = tmp_path / "cut.mcap"
    path.write_bytes(data[: int(len(data) * cut)])
    before = read_run(path)
    done = recover(path)
    after = read_run(done.path)
    assert path.read_bytes() == data[: int(len(data) * cut)]
    assert done.path.name == "cut.recovered.mcap"
    assert done.notes == before.notes
    assert not after.cut_short
    assert after.notes == []
    assert after.header == before.header
    assert after.events == before.events
    assert done.messages == len(after) + len(after.events) + len(after.link)
    for name, column in before.columns.items():
        np.testing.assert_array_equal(column, after.columns[name])
    with done.path.open("rb") as file:
        summary = make_reader(file).get_summary()
        assert summary is not None
        assert summary.statistics is not None
        assert summary.statistics.message_count == done.messages


def test_a_recovered_log_says_where_its_holes_are(tmp_path: Path) -> None:
    path = tmp_path / "damaged.mcap"
    data = bytearray(whole_log())
    start, end, _ = chunks()[1]
    data[(start + end) // 2] ^= 0xFF
    path.write_bytes(data)
    done = recover(path)
    assert done.holes == [(2.55, 5.12)]
    assert read_run(done.path).notes == [
        "no samples from 2.550 to 5.120 s: lost before it was recovered"
    ]


def test_a_whole_log_is_not_recovered(tmp_path: Path) -> None:
    path = write_small_run(tmp_path / "run.mcap")
    with pytest.raises(RunLogError, match="is whole"):
        recover(path)
    assert [p.name for p in tmp_path.iterdir()] == ["run.mcap"]


def test_recovery_never_overwrites_nor_removes_a_file(tmp_path: Path) -> None:
    path = tmp_path / "cut.mcap"
    path.write_bytes(whole_log()[:-2000])
    taken = tmp_path / "cut.recovered.mcap"
    taken.write_bytes(b"mine")
    for source in (path, tmp_path / "nothing.mcap"):
        with pytest.raises(RunLogError):
            recover(source, taken)
        assert taken.read_bytes() == b"mine"


def test_a_recovery_that_loses_power_leaves_no_half_under_the_name_of_the_whole(
    tmp_path: Path,
) -> None:
    path = tmp_path / "cut.mcap"
    path.write_bytes(whole_log()[:-2000])
    meanwhile: list[bool] = []
    done = recover(path, progress=lambda share: meanwhile.append(recovered_path(path).exists()))
    assert meanwhile
    assert not any(meanwhile)
    assert [p.name for p in sorted(tmp_path.iterdir())] == ["cut.mcap", done.path.name]


def test_nothing_is_left_behind_when_nothing_can_be_recovered(tmp_path: Path) -> None:
    path = tmp_path / "cut.mcap"
    for content in (b"hello", whole_log()[:100]):
        path.write_bytes(content)
        with pytest.raises(RunLogError, match="nothing can be recovered"):
            recover(path)
        assert [p.name for p in tmp_path.iterdir()] == ["cut.mcap"]


def test_a_list_of_runs_names_the_bad_ones_too(tmp_path: Path) -> None:
    write_small_run(tmp_path / "b.mcap", 10)
    (tmp_path / "a.mcap").write_bytes(whole_log()[:-3000])
    (tmp_path / "c.mcap").write_bytes(b"hello")
    listed = list_runs(tmp_path)
    assert [(Path(run.path).name, run.rows, run.problem) for run in listed] == [
        ("a.mcap", None, "cut short"),
        ("b.mcap", 10, ""),
        ("c.mcap", None, "no MCAP file"),
    ]
    assert listed[1].name == "test run"
    with pytest.raises(RunLogError, match="--folder"):
        list_runs(tmp_path / "nothing")


def test_a_summary_gives_range_and_mean_of_what_was_recorded(tmp_path: Path) -> None:
    summary = summarise(read_run(write_small_run(tmp_path / "run.mcap")))
    force = next(c for c in summary.channels if c.name == "force_N")
    assert (force.unit, force.recorded, force.least, force.mean, force.most) == (
        "N", 800, 1.25, 1.25, 1.25,
    )  # fmt: skip
    assert summary.rate_hz == 100.0
    assert summary.rows == ROWS


def test_a_log_whose_times_mostly_stay_has_no_rate(tmp_path: Path) -> None:
    write_run(
        tmp_path / "run.mcap", HEADER, [Row(t_s=1.0), Row(t_s=1.0), Row(t_s=1.0), Row(t_s=2.0)]
    )
    assert summarise(read_run(tmp_path / "run.mcap")).rate_hz is None


MUTATION = st.tuples(
    st.sampled_from(["flip", "cut", "insert", "delete", "zero"]),
    st.floats(0, 1),
    st.binary(min_size=1, max_size=12),
)


def mutated(data: bytes, mutations: list[tuple[str, float, bytes]]) -> bytes:
    changed = bytearray(data)
    for kind, where, noise in mutations:
        at = int(where * len(changed))
        span = slice(at, at + len(noise))
        if kind == "flip":
            changed[span] = bytes(a ^ b for a, b in zip(changed[span], noise, strict=False))
        elif kind == "cut":
            del changed[at:]
        elif kind == "insert":
            changed[at:at] = noise
        elif kind == "delete":
            del changed[span]
        else:
            changed[span] = bytes(len(changed[span]))
    return bytes(changed)


def check_any_file(data: bytes) -> None:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "run.mcap"
        path.write_bytes(data)
        list_runs(folder)
        try:
            run = read_run(path)
        except RunLogError as error:
            check_one_line(error)
        else:
            assert len(run) <= ROWS
            summarise(run)
        try:
            done = recover(path)
        except RunLogError as error:
            check_one_line(error)
        else:
            assert len(read_run(done.path)) <= ROWS


def check_one_line(error: RunLogError) -> None:
    assert len(str(error).splitlines()) == 1


@settings(max_examples=150, deadline=None, derandomize=True)
@given(st.lists(MUTATION, min_size=1, max_size=4))
def test_a_log_damaged_in_any_way_is_read_in_part_or_refused(
    mutations: list[tuple[str, float, bytes]],
) -> None:
    check_any_file(mutated(whole_log(), mutations))


@settings(max_examples=150, deadline=None, derandomize=True)
@given(st.lists(st.tuples(st.integers(1, 15), st.binary(max_size=40)), max_size=6), st.booleans())
def test_records_of_any_content_are_read_or_refused(
    records: list[tuple[int, bytes]], after_a_log: bool
) -> None:
    start = whole_log()[: chunks()[0][1]] if after_a_log else whole_log()[:8]
    check_any_file(
        start + b"".join(bytes([op]) + len(b).to_bytes(8, "little") + b for op, b in records)
    )


def packed_log(path: Path, topic: str, body: bytes, count: int, chunks: int) -> Path:
    """A log whose chunks hold `count` messages of one body each, packed to next to nothing."""
    with path.open("wb") as file:
        mcap = McapFile(FileIO(file.fileno(), "wb", closefd=False))
        channel = next(n for n, name in enumerate(TOPICS.values(), 1) if name == topic)
        message = pack(channel, 0, 1, body)
        for _ in range(chunks):
            mcap.write_chunk([message] * count)
        mcap.finish()
    return path


@pytest.mark.parametrize(
    ("topic", "body", "said"),
    [
        (ROW_TOPIC, b'{"t_s":1}', "25000 samples"),
        (EVENT_TOPIC, b" " * 900, "beside the samples"),
    ],
)
def test_a_small_log_that_unpacks_to_more_than_a_run_is_refused_before_it_is_held(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, topic: str, body: bytes, said: str
) -> None:
    path = packed_log(tmp_path / "packed.mcap", topic, body, 10_000, 3)
    most = {"MOST_LOG_ROWS": 25_000, "MOST_LOG_BYTES": 20_000_000}
    for name, value in most.items():
        monkeypatch.setattr(reader, name, value)
    assert path.stat().st_size < 500_000
    with pytest.raises(RunLogError, match=f"longer than a run log can be; got .*{said}") as refused:
        read_run(path)
    check_one_line(refused.value)


def test_a_log_as_long_as_the_recorder_makes_it_is_read() -> None:
    longest = msgspec.json.schema(RecorderConfig)["$defs"]["RecorderConfig"]["properties"]
    assert longest["max_file_min"]["maximum"] * 60 * FASTEST_HZ < MOST_LOG_ROWS


def test_progress_ends_at_the_whole(tmp_path: Path) -> None:
    path = write_small_run(tmp_path / "run.mcap", 100)
    told: list[float] = []
    read_run(path, progress=told.append)
    assert told == sorted(told)
    assert told[-1] == 1.0
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(path.read_bytes()[:-100])
    told.clear()
    recover(cut, progress=told.append)
    assert told[-1] == 1.0
