"""What a sealed bank asks before its key is used."""

import json
from pathlib import Path

from smad.gap.check.key import SEALED, file_digest
from tests.withheld.errors import BankError
from tests.withheld.openings import Ledger, checkout


def require_logged(bank: str, key_sha256: str, verdicts: Path) -> None:
    """Raises SmadError when verdicts on the sealed bank were not scored, and logged, before."""
    if bank == SEALED:
        ledger = Ledger.of(checkout())
        ledger.require_sealed(key_sha256)
        ledger.require_entered(file_digest(verdicts))


def refuse_sealed(key: Path) -> None:
    """Raises BankError for a sealed key: before the verdicts are frozen nothing reads it."""
    if json.loads((key / "KEY.json").read_text())["bank"] == SEALED:
        raise BankError(f"{key} is sealed: give verdicts without it, and score them with `score`")
