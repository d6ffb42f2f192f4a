"""The sealed banks: a key's hash comes first, and every use of the key is entered in a log.

Both live in the repository, so that a sealed key is scored from a checkout only.
"""

from __future__ import annotations

import datetime
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from evaluation.errors import BankError, KeyMismatchError
from evaluation.results.record import FOLDER
from evaluation.score.answers import digest, read_key
from evaluation.score.goals import Row

SEALED = "sealed"


@dataclass(frozen=True)
class Ledger:
    """Where the hashes of sealed keys stand, and where openings are entered."""

    seals: Path
    record: Path

    @classmethod
    def of(cls, folder: Path = FOLDER) -> Ledger:
        """The ledger of a folder of results, this checkout's if not given."""
        return cls(folder / "keys.sha256", folder / "openings.jsonl")

    def seal(self, key_sha256: str, name: str) -> None:
        """Enter the hash of a new key."""
        with self.seals.open("a") as out:
            out.write(f"{key_sha256}  {name}\n")

    def require_sealed(self, key_sha256: str) -> None:
        """Raises KeyMismatchError unless the key's hash was entered, and the key never opened."""
        lines = self.seals.read_text().splitlines()
        if key_sha256 not in [line.split()[0] for line in lines if line.strip()]:
            raise KeyMismatchError(
                f"the hash {key_sha256[:16]}… of this sealed key is not in {self.seals.name}: "
                "commit its hash before the first answer, or bring the key that was sealed"
            )
        if self.opened(key_sha256):
            raise KeyMismatchError(
                f"the key {key_sha256[:16]}… was opened before ({self.record.name}): seal another "
                "bank for another claim"
            )

    def opened(self, key_sha256: str) -> bool:
        """Whether a key was opened, after which its bank is a development bank."""
        lines = self.record.read_text().splitlines() if self.record.exists() else []
        return key_sha256 in [json.loads(line)["key_sha256"] for line in lines]

    def enter(
        self,
        key_sha256: str,
        verdicts_sha256: str,
        scores: Mapping[str, Sequence[Row]],
        *,
        cases: int,
        commit: str,
        source_sha256: str,
        now: datetime.datetime,
    ) -> None:
        """Append one opening to the record; `commit` scored, code of `source_sha256` answered."""
        line = {
            "opened": now.astimezone(datetime.UTC).strftime("%Y-%m-%d %H:%M"),
            "commit": commit,
            "key_sha256": key_sha256,
            "verdicts_sha256": verdicts_sha256,
            "source_sha256": source_sha256,
            "cases": cases,
            "scores": {
                f"{question}: {r.name}": None if r.value is None else round(r.value, 4)
                for question, rows in scores.items()
                for r in rows
            },
        }
        with self.record.open("a") as out:
            out.write(json.dumps(line, ensure_ascii=False) + "\n")


def refuse_sealed(key: Path) -> None:
    """Raises BankError for a sealed key that was not opened: nothing reads it before `score`.

    `key` is the file, or the folder of its `KEY.json`. Raises WithheldError for what is none.
    """
    file = key / "KEY.json" if key.is_dir() else key
    if read_key(file).bank == SEALED and not Ledger.of().opened(digest(file)):
        raise BankError(f"{key} is sealed: give answers without it, and score them with `score`")
