"""Every generated file and its text."""

from __future__ import annotations

import re
import zlib
from pathlib import Path

import msgspec

from firmware_protocol.codec import CODEC
from firmware_protocol.generate import c_header, c_source, document, vectors
from firmware_protocol.schema import canonical_json, compress, describe

PACKAGE = Path(__file__).resolve().parent.parent
DOCUMENT = PACKAGE.parent / "docs" / "protocol.md"


def generated() -> dict[Path, str]:
    """Return the text of each generated file by its path.

    Raises SchemaError if the document's markers are damaged.
    """
    description = describe()
    schema = msgspec.json.format(canonical_json(description), indent=1).decode() + "\n"
    source = PACKAGE / "c" / "smad_protocol.c"
    blob = _blob(source, canonical_json(description)) or compress(description)
    files = {
        PACKAGE / "schema.json": schema,
        PACKAGE / "c" / "smad_protocol.h": c_header.render(CODEC, len(blob)),
        source: c_source.render(CODEC, blob),
        PACKAGE / "vectors" / "messages.json": vectors.messages(CODEC),
        PACKAGE / "vectors" / "streams.json": vectors.streams(CODEC),
    }
    if DOCUMENT.exists():
        files[DOCUMENT] = document.fill(DOCUMENT.read_text(encoding="utf-8"), CODEC)
    return files


def stale() -> list[Path]:
    """Return the files whose text on disk is not what the tables give."""
    return [
        path
        for path, text in generated().items()
        if not path.exists() or path.read_text(encoding="utf-8") != text
    ]


def _blob(source: Path, text: bytes) -> bytes | None:
    """Return the compressed schema in the C file if it still inflates to `text`.

    Builds of zlib differ in the bytes they make of the same text, so that a machine with another
    zlib would find the file stale although nothing changed.
    """
    if not source.exists():
        return None
    match = re.search(r"smad_schema\[[^\]]*\] = \{([^}]*)\}", source.read_text(encoding="utf-8"))
    if match is None:
        return None
    blob = bytes(int(number, 16) for number in re.findall(r"0x[0-9a-f]{2}", match[1]))
    try:
        return blob if zlib.decompress(blob) == text else None
    except zlib.error:
        return None
