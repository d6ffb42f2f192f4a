"""Verdict files: what a diagnosis hands in for each case (docs/guide/check-your-own-bank.md)."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Literal

import msgspec

from smad.diagnosis.bank.errors import VerdictError
from smad.diagnosis.verdict import Verdict

FORMAT = "smad-verdicts-2"


class VerdictFile(msgspec.Struct, frozen=True, kw_only=True, omit_defaults=True):
    """A whole verdict file. `notes` says of a case why it has no verdict."""

    format: Literal["smad-verdicts-2"]
    bank: str
    key_sha256: str
    verdicts: dict[str, Verdict]
    tool: dict[str, Any] = {}
    notes: dict[str, str] = {}


def read_verdicts(path: Path) -> VerdictFile:
    """A verdict file. Raises VerdictError, which says what is wrong where."""
    try:
        return msgspec.json.decode(path.read_bytes(), type=VerdictFile)
    except OSError as error:
        raise VerdictError(
            f"{path} cannot be read", value=error.strerror, action="check the path"
        ) from error
    except msgspec.DecodeError as error:
        raise VerdictError(
            f"{path} is not a verdict file",
            value=str(error),
            limit=FORMAT,
            action="see “Verdicts” in smad docs guide/check-your-own-bank",
        ) from error


def write_verdicts(path: Path, file: VerdictFile) -> None:
    """Writes a verdict file as indented JSON; a reader never sees half of one."""
    partial = path.with_name(path.name + ".part")
    partial.write_bytes(msgspec.json.format(msgspec.json.encode(file), indent=1) + b"\n")
    partial.replace(path)
