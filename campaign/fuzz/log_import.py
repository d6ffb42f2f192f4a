"""`smad log import`: a CSV is refused with its line, or becomes a log that reads the same."""

from __future__ import annotations

import numpy as np

from campaign.fuzz.files import file_with, no_file
from campaign.fuzz.program import require
from smad.errors import LogImportError
from smad.records.channels import read_mapping
from smad.records.importer import import_table
from smad.runlog.reader import read_run

SEPARATOR = b"\f"
"""Between the CSV, the mapping file and the header beside the CSV; the last two may be left out."""


def run(data: bytes) -> None:
    """The input is the CSV, and, behind form feeds, a mapping file and a header."""
    csv, *others = data.split(SEPARATOR, 2)
    source = file_with("elsewhere.csv", csv)
    mapping_text = others[0] if others else b""
    beside = no_file("elsewhere.header.json")
    if len(others) > 1:
        beside.write_bytes(others[1])
    target = no_file("elsewhere.mcap")
    try:
        mapping = read_mapping(file_with("mapping.toml", mapping_text)) if mapping_text else None
        done = import_table(source, target, mapping)
    except LogImportError as error:
        require(len(str(error).splitlines()) == 1, "a refusal of several lines, or of none")
        require(not target.exists(), "an import that was refused left a file")
        return
    read = read_run(target)
    require(len(read) == done.rows, "{} rows went in, {} came out", done.rows, len(read))
    require(done.rows > 0, "an import without rows was not refused")
    require(not read.cut_short and not read.notes, "not a whole log: {}", read.notes)
    t_s = read.columns["t_s"]
    require(np.isfinite(t_s).all() and (np.diff(t_s) > 0).all(), "time does not increase")
    require(read.header.source == "import", "the header does not say that it was imported")
    for name in done.channel_of.values():
        column = read.columns[name]
        require(not np.isinf(column).any(), "{} holds an infinite number", name)
    require(
        set(done.missing) | set(done.channel_of.values()) == set(read.columns),
        "a channel is neither imported nor missing",
    )
