"""What a sealed bank asks before its key is used."""

import json
from pathlib import Path

from evaluation.errors import BankError
from smad.diagnosis.bank.key import SEALED


def refuse_sealed(key: Path) -> None:
    """Raises BankError for a sealed key: before the verdicts are frozen nothing reads it."""
    if json.loads((key / "KEY.json").read_text())["bank"] == SEALED:
        raise BankError(f"{key} is sealed: give verdicts without it, and score them with `score`")
