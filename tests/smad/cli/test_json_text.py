"""What is printed for a program is JSON, whatever the names of files are."""

import os
from pathlib import Path

import msgspec
import pytest

from smad.cli.output import json_text


@pytest.mark.parametrize("indent", [-1, 2])
def test_a_file_name_that_is_no_utf8_is_told_by_its_bytes(indent: int) -> None:
    name = os.fsdecode(b"r\xc3\xa9-\xff.csv")
    told = msgspec.json.decode(json_text({"files": [Path(name)], "gap": float("nan")}, indent))
    assert told == {"files": [r"ré-\xff.csv"], "gap": None}
