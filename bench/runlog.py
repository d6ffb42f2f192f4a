"""What recording costs: `python -m bench.runlog` prints it, `rows()` returns it.

The wall clock and a temporary folder are used; nothing here is a test.
"""

from __future__ import annotations

import random
import statistics
import tempfile
import threading
import time
from collections.abc import Iterator
from io import FileIO
from pathlib import Path
from typing import NamedTuple

import numpy as np
from mcap.writer import Writer

from smad.runlog.header import RunHeader
from smad.runlog.mcap_file import MESSAGE, McapFile
from smad.runlog.pack import RecordPacker
from smad.runlog.reader import read_run
from smad.runlog.schema import ROW_TOPIC, Row, json_schema
from smad.runlog.writer import RunWriter, write_run

_STARTED_UNIX_S = 1.79e9
_PACED_S = 6.0
_SPIN_S = 3.0
_WINDOW_S = 0.25
_ROWS_READ = 90_000
_ROWS_WRITTEN = 25_000
_ROWS_A_FLUSH = 125
_ROWS_AN_HOUR = {100: 360_000, 250: 900_000, 500: 1_800_000}


class Measured(NamedTuple):
    """One line of the benchmark table."""

    name: str
    value: float
    unit: str


def sample_rows(count: int, rate_hz: int, seed: int = 0) -> Iterator[Row]:
    """Rows as noisy and as finely quantised as the bench's, every channel but the stage filled."""
    noise = random.Random(seed)
    displacement_um = 0
    for tick in range(count):
        t_s = round(tick / rate_hz, 6)
        displacement_um += noise.randrange(-8, 9)
        current_mA = noise.randrange(0, 4001)
        yield Row(
            t_s=t_s,
            host_time_s=_STARTED_UNIX_S + t_s + noise.random() * 1e-4,
            tick=tick & 0xFFFF,
            i_cmd_x_A=current_mA / 1000 + noise.random() * 1e-3,
            i_cmd_y_A=0.0,
            i_applied_x_A=current_mA / 1000,
            i_applied_y_A=0.0,
            i_meas_x_A=(current_mA + noise.randrange(-9, 10)) / 1000,
            i_meas_y_A=noise.randrange(0, 9) / 1000,
            v_x_V=current_mA * 76 // 100 / 1000,
            v_y_V=noise.randrange(0, 9) / 1000,
            duty_x=0.0,
            duty_y=1.0,
            drain_x=0,
            drain_y=0,
            rtd_x_degC=(4800 + noise.randrange(-4, 5)) / 100,
            rtd_y_degC=(2700 + noise.randrange(-4, 5)) / 100,
            rtd_inlet_degC=(2685 + noise.randrange(-2, 3)) / 100,
            rtd_ambient_degC=26.85,
            displacement_mm=displacement_um / 1000,
            angle_deg=displacement_um / 1000 * 6.25,
            force_N=(1743 + noise.randrange(-9, 10)) / 1000,
            supply_V=(12_000 + noise.randrange(-20, 21)) / 1000,
            reference_mm=10.0,
            mode=2,
            limiter=0,
            faults=0,
            warnings=0,
            valid=255,
            setpoint_age_ms=float(noise.randrange(1, 3)),
        )


def rows() -> list[Measured]:
    """Measure everything; takes about half a minute."""
    with tempfile.TemporaryDirectory() as folder:
        here = Path(folder)
        return [
            *_append_cost(here),
            *_longest_gaps(here),
            *_writing(here),
            *_reading(here),
            *_sizes(here),
        ]


def _header() -> RunHeader:
    return RunHeader(source="sim", name="bench", started_unix_s=_STARTED_UNIX_S)


def _append_cost(folder: Path) -> list[Measured]:
    rate_hz = 500
    prepared = list(sample_rows(int(_PACED_S * rate_hz), rate_hz))
    cost_ns = []
    with RunWriter(folder / "paced.mcap", _header()) as writer:
        started_ns = time.perf_counter_ns()
        cpu_ns = time.process_time_ns()
        for number, row in enumerate(prepared):
            due_ns = started_ns + number * 1_000_000_000 // rate_hz
            time.sleep(max(0, due_ns - time.perf_counter_ns()) / 1e9)
            before_ns = time.perf_counter_ns()
            writer.append(row)
            cost_ns.append(time.perf_counter_ns() - before_ns)
        cpu_share = (time.process_time_ns() - cpu_ns) / (time.perf_counter_ns() - started_ns)
    p50, p99_9 = np.percentile(cost_ns, [50, 99.9]) / 1e3
    return [
        Measured("append at 500 Hz, p50", p50, "µs"),
        Measured("append at 500 Hz, p99.9", p99_9, "µs"),
        Measured("append at 500 Hz, worst", max(cost_ns) / 1e3, "µs"),
        Measured("processor share of recording at 500 Hz, pacing included", cpu_share * 100, "%"),
        Measured("rows dropped", writer.dropped, "rows"),
    ]


def _longest_gaps(folder: Path) -> list[Measured]:
    """How long a thread that never rests is kept from running: alone, and beside the writer.

    The median over quarters of a second of the longest gap in each, so that what else the machine
    does shows in both numbers and in neither alone. It includes two hand-overs of the interpreter.
    """
    return [
        Measured("longest gap per 0.25 s in a spinning thread, no writer", _gap_us(None), "µs"),
        Measured(
            "longest gap per 0.25 s in a spinning thread, writer at 500 Hz",
            _gap_us(folder / "gaps.mcap"),
            "µs",
        ),
    ]


def _gap_us(path: Path | None) -> float:
    writer = RunWriter(path, _header()) if path is not None else None
    prepared = sample_rows(int(_SPIN_S * 500), 500)
    longest_ns: list[int] = []
    clock = time.perf_counter_ns
    start_ns = clock()
    due_ns = start_ns
    while len(longest_ns) < _SPIN_S / _WINDOW_S:
        longest = 0
        window_end_ns = start_ns + (len(longest_ns) + 1) * int(_WINDOW_S * 1e9)
        last_ns = clock()
        while last_ns < window_end_ns:
            now_ns = clock()
            longest = max(longest, now_ns - last_ns)
            if now_ns >= due_ns:
                row = next(prepared, None)
                if writer is not None and row is not None:
                    writer.append(row)
                due_ns += 2_000_000
                now_ns = clock()
            last_ns = now_ns
        longest_ns.append(longest)
    if writer is not None:
        writer.close()
    return statistics.median(longest_ns) / 1e3


def _writing(folder: Path) -> list[Measured]:
    """Processor time of a row on the thread's side, beside the `mcap` package's own writer."""
    packer = RecordPacker(_STARTED_UNIX_S)
    packed = [packer.pack(row) for row in sample_rows(_ROWS_WRITTEN, 500)]
    with FileIO(folder / "ours.mcap", "xb") as file:
        ours = McapFile(file)
        before = time.thread_time()
        for first_row in range(0, _ROWS_WRITTEN, _ROWS_A_FLUSH):
            ours.write_chunk(packed[first_row : first_row + _ROWS_A_FLUSH])
        ours_us = (time.thread_time() - before) / _ROWS_WRITTEN * 1e6
    with (folder / "theirs.mcap").open("xb") as plain:
        theirs = Writer(plain, chunk_size=2**40)
        theirs.start()
        schema = theirs.register_schema("row", "jsonschema", json_schema(Row))
        channel = theirs.register_channel(ROW_TOPIC, "json", schema)
        bodies = [message.data[MESSAGE.size :] for message in packed]
        before = time.thread_time()
        for number, body in enumerate(bodies):
            theirs.add_message(channel, number, body, number)
        theirs_us = (time.thread_time() - before) / _ROWS_WRITTEN * 1e6
    return [
        Measured("thread's time for a row, compressed and written", ours_us, "µs"),
        Measured("the mcap package's writer, before compression", theirs_us, "µs"),
    ]


def _reading(folder: Path) -> list[Measured]:
    path = folder / "read.mcap"
    write_run(path, _header(), sample_rows(_ROWS_READ, 500))
    before = time.perf_counter()
    run = read_run(path)
    speed = len(run) / (time.perf_counter() - before)
    return [
        Measured("reading", speed, "rows/s"),
        Measured("reading an hour at 500 Hz", _ROWS_AN_HOUR[500] / speed, "s"),
    ]


def _sizes(folder: Path) -> list[Measured]:
    """From a minute written as the recorder writes: a chunk each quarter of a second."""
    measured = []
    for rate_hz, an_hour in _ROWS_AN_HOUR.items():
        path = folder / f"size-{rate_hz}.mcap"
        count = 60 * rate_hz
        flushed = threading.Event()
        with RunWriter(path, _header(), flush_interval_s=0.005, queue_rows=count) as writer:
            for number, row in enumerate(sample_rows(count, rate_hz)):
                writer.append(row)
                if (number + 1) % (rate_hz // 4) == 0:
                    flushed.wait(0.01)
        size_MB = path.stat().st_size / 1e6 * an_hour / count
        measured.append(Measured(f"file size, an hour at {rate_hz} Hz", size_MB, "MB"))
    return measured


if __name__ == "__main__":
    for name, value, unit in rows():
        print(f"{name:<58}{value:>12.4g} {unit}")
