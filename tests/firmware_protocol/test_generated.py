"""The generated files are those that the tables give, and the check can tell."""

import re
import subprocess
import sys
import zlib
from pathlib import Path

import pytest

from firmware_protocol.codec import CODEC
from firmware_protocol.errors import SchemaError
from firmware_protocol.generate import outputs
from firmware_protocol.generate.document import TABLES, fill
from firmware_protocol.schema import canonical_json, describe, own_crc


def test_no_generated_file_is_stale() -> None:
    assert outputs.stale() == [], "run python -m firmware_protocol.generate"
    assert outputs.DOCUMENT in outputs.generated()


def test_the_check_fails_and_names_a_file_that_was_changed_by_hand(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    target = tmp_path / "package"
    document = tmp_path / "protocol.md"
    document.write_text(outputs.DOCUMENT.read_text(encoding="utf-8"), encoding="utf-8")
    monkeypatch.setattr(outputs, "PACKAGE", target)
    monkeypatch.setattr(outputs, "DOCUMENT", document)
    for path, text in outputs.generated().items():
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")
    assert outputs.stale() == []
    header = target / "c" / "smad_protocol.h"
    header.write_text(header.read_text().replace("MAX_PAYLOAD 120", "MAX_PAYLOAD 119"))
    assert outputs.stale() == [header]
    (target / "schema.json").unlink()
    assert outputs.stale() == [target / "schema.json", header]
    text = document.read_text(encoding="utf-8")
    document.write_text(re.sub(r"\b(\d+) bytes", r"1\1 bytes", text), encoding="utf-8")
    assert outputs.stale() == [target / "schema.json", header, document]


def test_the_command_ends_with_status_zero_when_nothing_is_stale() -> None:
    command = [sys.executable, "-m", "firmware_protocol.generate", "--check"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")


def test_the_compressed_schema_of_another_zlib_is_not_stale(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    target = tmp_path / "package"
    monkeypatch.setattr(outputs, "PACKAGE", target)
    (target / "c").mkdir(parents=True)
    other = zlib.compress(canonical_json(describe()), 1)
    text = "smad_schema[SIZE] = {" + " ".join(f"0x{byte:02x}," for byte in other) + "}"
    (target / "c" / "smad_protocol.c").write_text(text)
    source = outputs.generated()[target / "c" / "smad_protocol.c"]
    assert len(re.findall("0x[0-9a-f]{2},", source)) == len(other)


def test_the_header_carries_the_schema_crc_that_the_board_has_to_send() -> None:
    header = (outputs.PACKAGE / "c" / "smad_protocol.h").read_text()
    assert f"SMAD_SCHEMA_CRC 0x{own_crc():08X}u" in header


@pytest.mark.parametrize(
    ("text", "words"),
    [("no markers at all", "fields"), ("<!-- generated: nonsense -->\n<!-- end -->", "nonsense")],
)
def test_a_document_whose_markers_are_damaged_is_refused(text: str, words: str) -> None:
    with pytest.raises(SchemaError, match=words):
        fill(text, CODEC)


def test_filling_the_document_twice_changes_nothing() -> None:
    marked = "".join(f"<!-- generated: {name} -->\n<!-- end -->\n" for name in TABLES)
    once = fill(marked, CODEC)
    assert fill(once, CODEC) == once
    assert all(name in once for name in ("SETPOINT", "state_rate_hz", "WRONG_STATE"))
