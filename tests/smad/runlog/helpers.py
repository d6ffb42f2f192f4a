"""Small runs with known content, shared by the tests of the run log."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from smad.runlog.header import RunHeader
from smad.runlog.schema import Event, LinkSample, Row
from smad.runlog.writer import write_run

HEADER = RunHeader(
    source="sim",
    name="test run",
    started_unix_s=1.79e9,
    rate_hz=100.0,
    seed=7,
    configuration="[link]\nbaud = 115200\n",
    parameter_file="[wire]\nlength_m = 0.408\n",
    gains={"kp_A_per_mm": 15.0},
    versions={"smad": "0.1.0"},
    board={"firmware": "sim"},
    message_schema='{"messages": []}',
    notes=["a note"],
)


def rows(count: int, start: int = 0) -> Iterator[Row]:
    """Rows at 100 Hz in which each channel filled tells the row's number."""
    for n in range(start, start + count):
        yield Row(
            t_s=n / 100,
            host_time_s=1.79e9 + n / 100,
            tick=n & 0xFFFF,
            i_cmd_x_A=n / 1000,
            duty_y=0.5,
            rtd_x_degC=20 + n / 100,
            displacement_mm=None if n % 3 == 0 else n / 1000,
            force_N=float("nan") if n % 5 == 0 else 1.25,
            mode=2,
            faults=0 if n % 2 else 0x80000001,
        )


def write_small_run(path: Path, count: int = 1000) -> Path:
    """A whole run of `count` rows, two events and one link sample."""
    write_run(
        path,
        HEADER,
        [
            *rows(count),
            Event(t_s=1.0, kind="arm", text="armed"),
            Event(t_s=2.0, kind="fault", text="too hot", data={"channel": "rtd_x", "value": 90.5}),
            LinkSample(t_s=2.0, counters={"crc_errors": 3.0}),
        ],
    )
    return path


def row_numbers(columns: dict[str, np.ndarray]) -> list[int]:
    """The numbers of the rows that were read, from board time."""
    return [round(t * 100) for t in columns["t_s"]]
