"""The sealed bank: its key's hash comes first, and every use of the key is entered in a log.

Both live in the repository, so that a sealed key is scored from a checkout only. The record is
docs/withheld-openings.jsonl; docs/withheld-openings.md is made from it.
"""

from __future__ import annotations

import datetime
import json
from dataclasses import dataclass
from pathlib import Path

import smad
from smad.gap.check.errors import KeyMismatchError
from tests.withheld.scores import Published

HEAD = """# Openings of the sealed bank

Made from `withheld-openings.jsonl` by the scoring command, which adds a line whenever it is given
a sealed key. Nothing may be tuned on what these lines say; see [withheld.md](withheld.md).

| opened (UTC) | commit | key | verdicts | cases answered | table |
|---|---|---|---|---|---|
"""


@dataclass(frozen=True)
class Ledger:
    """Where the hashes of sealed keys stand, and where openings are entered."""

    seals: Path
    record: Path
    page: Path

    @classmethod
    def of(cls, root: Path) -> Ledger:
        """The ledger of a checkout."""
        return cls(
            root / "tests" / "withheld" / "keys.sha256",
            root / "docs" / "withheld-openings.jsonl",
            root / "docs" / "withheld-openings.md",
        )

    def require_sealed(self, key_sha256: str) -> None:
        """Raises KeyMismatchError unless the key's hash was committed before."""
        try:
            lines = self.seals.read_text().splitlines()
        except OSError as error:
            raise KeyMismatchError(
                "a sealed key can be scored in a checkout of the repository only",
                value=f"{self.seals}: {error.strerror}",
                action="run the command from an editable installation of the checkout",
            ) from error
        if key_sha256 not in [line.split()[0] for line in lines if line.strip()]:
            raise KeyMismatchError(
                f"the hash of this sealed key is not in {self.seals.name}",
                value=f"{key_sha256[:16]}…",
                action="commit its hash before the first verdict, or bring the key that was sealed",
            )

    def require_entered(self, verdicts_sha256: str) -> None:
        """Raises KeyMismatchError unless these verdicts have been scored with the sealed key."""
        text = self.record.read_text() if self.record.exists() else ""
        known = [json.loads(line)["verdicts_sha256"] for line in text.splitlines()]
        if verdicts_sha256 not in known:
            raise KeyMismatchError(
                "these verdicts on the sealed bank have not been scored yet",
                value=f"{verdicts_sha256[:16]}…",
                limit=f"those entered in {self.record.name}",
                action="freeze and score them first: python -m tests.withheld score VERDICTS KEY",
            )

    def enter(
        self, key_sha256: str, verdicts_sha256: str, scores: Published, *, commit: str,
        now: datetime.datetime,
    ) -> None:  # fmt: skip
        """Append one opening to the record and make the page anew."""
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
        self.page.write_text(self.rendered())

    def rendered(self) -> str:
        """The page for the record, which may be absent or empty."""
        rows = []
        text = self.record.read_text() if self.record.exists() else ""
        for line in text.splitlines():
            entry = json.loads(line)
            scores = "; ".join(f"{n} {v}" for n, v in entry["scores"].items() if v is not None)
            rows.append(
                f"| {entry['opened']} | {entry['commit']} | {entry['key_sha256'][:12]} "
                f"| {entry['verdicts_sha256'][:12]} | {entry['answered']}/{entry['cases']} "
                f"| {scores} |\n"
            )
        return HEAD + ("".join(rows) or "| not opened yet | | | | | |\n")


def checkout() -> Path:
    """The folder that holds the smad package: the repository, in an editable installation."""
    return Path(smad.__file__).resolve().parents[1]
