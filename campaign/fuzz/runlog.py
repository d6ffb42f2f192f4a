"""The reader of run logs: whole rows only, whatever a crash or a disk left of the file."""

from __future__ import annotations

from io import BytesIO
from pathlib import Path

import msgspec
import numpy as np
from click.testing import CliRunner
from mcap import records

from campaign.fuzz.files import file_with, folder, no_file
from campaign.fuzz.program import require
from smad.cli.log import log
from smad.errors import RunLogError
from smad.runlog.overview import list_runs
from smad.runlog.reader import Run, read_run
from smad.runlog.recover import recover
from smad.runlog.scan import Damage, Message, scan
from smad.runlog.schema import CHANNELS, ROW_TOPIC, TOPICS, Row

_COMMAND_LINE = CliRunner()
_ROW = msgspec.json.Decoder(Row)


def run(data: bytes) -> None:
    """The input is the file."""
    path = file_with("run.mcap", data)
    overview = [line for line in list_runs(folder()) if line.path == str(path)]
    require(len(overview) == 1, "the file is not in the list of its folder")
    try:
        read = read_run(path)
    except RunLogError as error:
        require(str(error).strip(), "a refusal without words")
        read = None
    if read is not None:
        _whole_rows_only(read, data)
        _shown(path)
    target = no_file("recovered.mcap")
    try:
        recover(path, target)
    except RunLogError as error:
        require(str(error).strip(), "a refusal without words")
        require(not target.exists(), "a recovery that was refused left a file")
        return
    if read is None:
        return
    again = read_run(target)
    require(not again.cut_short and again.damaged == 0, "a recovered log is not whole")
    for name in CHANNELS:
        require(
            np.array_equal(again.columns[name], read.columns[name], equal_nan=True),
            "recovery changed {}",
            name,
        )
    require(again.events == read.events and again.link == read.link, "recovery changed events")


def _shown(path: Path) -> None:
    for arguments in (["show", str(path)], ["list", "--folder", str(path.parent)]):
        printed = _COMMAND_LINE.invoke(log, arguments)
        if printed.exception is not None:
            raise printed.exception
        require(path.name in printed.output, "{} does not name the file", arguments[0])


def _whole_rows_only(read: Run, data: bytes) -> None:
    rows = len(read)
    written = _rows_written(data)
    require(rows == written, "{} rows from {} whole messages", rows, written)
    require(list(read.columns) == list(CHANNELS), "a channel is missing")
    for name, column in read.columns.items():
        require(column.shape == (rows,), "{} has {}, not {} rows", name, column.shape, rows)
        require(column.dtype == CHANNELS[name].dtype, "{} is {}", name, column.dtype)
        if column.dtype.kind == "f":
            require(not np.isinf(column).any(), "{} holds an infinite number", name)
    require(np.isfinite(read.columns["t_s"]).all(), "a row of {} has no time", ROW_TOPIC)
    require(read.dropped >= 0 and read.damaged >= 0, "a count below zero")


def _rows_written(data: bytes) -> int:
    """Count the messages that are rows by themselves, without what the reader makes of them."""
    topics: dict[int, str] = {}
    whole = 0
    for item in scan(BytesIO(data), len(data), Damage()):
        if isinstance(item, records.Channel):
            if item.topic in TOPICS.values():
                topics[item.id] = item.topic
        elif isinstance(item, Message) and topics.get(item.channel_id) == ROW_TOPIC:
            try:
                _ROW.decode(item.body)
            except (msgspec.MsgspecError, RecursionError, UnicodeDecodeError):
                continue
            whole += 1
    return whole
