"""The sealed bank: its key's hash comes first, and every use of the key is entered in a log.

Both live in the repository, so that a sealed key is scored from a checkout only.
"""

from __future__ import annotations

import datetime
import json
from dataclasses import dataclass
from pathlib import Path

from evaluation.results.record import FOLDER
from evaluation.score.scores import Published
from smad.diagnosis.bank.errors import KeyMismatchError


@dataclass(frozen=True)
class Ledger:
    """Where the hashes of sealed keys stand, and where openings are entered."""

    seals: Path
    record: Path

    @classmethod
    def of(cls, folder: Path = FOLDER) -> Ledger:
        """The ledger of a folder of results, this checkout's if not given."""
        return cls(folder / "keys.sha256", folder / "openings.jsonl")

    def require_sealed(self, key_sha256: str) -> None:
        """Raises KeyMismatchError unless the key's hash was committed before."""
        try:
            lines = self.seals.read_text().splitlines()
        except OSError as error:
            raise KeyMismatchError(
                "a sealed key can be scored in a checkout of the repository only",
                value=f"{self.seals}: {error.strerror}",
                action="run the command in a checkout",
            ) from error
        if key_sha256 not in [line.split()[0] for line in lines if line.strip()]:
            raise KeyMismatchError(
                f"the hash of this sealed key is not in {self.seals.name}",
                value=f"{key_sha256[:16]}…",
                action="commit its hash before the first verdict, or bring the key that was sealed",
            )

    def enter(
        self, key_sha256: str, verdicts_sha256: str, scores: Published, *, commit: str,
        now: datetime.datetime,
    ) -> None:  # fmt: skip
        """Append one opening to the record."""
        line = {
            "opened": now.astimezone(datetime.UTC).strftime("%Y-%m-%d %H:%M"),
            "commit": commit,
            "key_sha256": key_sha256,
            "verdicts_sha256": verdicts_sha256,
            "cases": scores.cases,
            "answered": scores.answered,
            "scores": {
                r.name: None if r.value is None else round(r.value, 4) for r in scores.table
            },
        }
        with self.record.open("a") as out:
            out.write(json.dumps(line, ensure_ascii=False) + "\n")
