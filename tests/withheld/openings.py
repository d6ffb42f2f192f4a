"""The log of openings: every time the sealed key is used, with date, commit and scores.

The record is docs/withheld-openings.jsonl; docs/withheld-openings.md is made from it.
"""

import datetime
import json
import math
import subprocess
from pathlib import Path
from typing import Any

from tests.withheld.errors import KeyMismatchError

ROOT = Path(__file__).resolve().parents[2]
RECORD = ROOT / "docs" / "withheld-openings.jsonl"
PAGE = ROOT / "docs" / "withheld-openings.md"
SEALS = Path(__file__).with_name("keys.sha256")

HEAD = """# Openings of the sealed bank

Made from `withheld-openings.jsonl` by the scoring command, which adds a line whenever it is given
a sealed key. Nothing may be tuned on what these lines say; see [withheld.md](withheld.md).

| opened (UTC) | commit | key | verdicts | cases answered | table |
|---|---|---|---|---|---|
"""


def commit() -> str:
    """The repository's commit, with a plus sign when files have been changed since."""
    try:
        head = subprocess.run(
            ["git", "-C", str(ROOT), "rev-parse", "--short=12", "HEAD"],
            capture_output=True, text=True, check=True,
        ).stdout.strip()  # fmt: skip
        dirty = subprocess.run(
            ["git", "-C", str(ROOT), "status", "--porcelain", "--untracked-files=no"],
            capture_output=True, text=True, check=True,
        ).stdout.strip()  # fmt: skip
    except (OSError, subprocess.CalledProcessError):
        return "unknown"
    return head + ("+" if dirty else "")


def require_sealed(key_sha256: str, seals: Path = SEALS) -> None:
    """Raise KeyMismatchError unless the key's hash was committed before."""
    known = [line.split()[0] for line in seals.read_text().splitlines() if line.strip()]
    if key_sha256 not in known:
        raise KeyMismatchError(
            f"this sealed key has SHA-256 {key_sha256[:16]}…, which is not in {seals.name}: "
            "commit its hash before the first verdict, or bring the key that was sealed"
        )


def enter(
    key_sha256: str, verdicts_sha256: str, report: dict[str, Any], now: datetime.datetime,
    *, record: Path = RECORD, page: Path = PAGE,
) -> None:  # fmt: skip
    """Append one opening to the record and make the page anew."""
    line = {
        "opened": now.astimezone(datetime.UTC).strftime("%Y-%m-%d %H:%M"),
        "commit": commit(),
        "key_sha256": key_sha256,
        "verdicts_sha256": verdicts_sha256,
        "cases": report["cases"],
        "answered": report["answered"],
        "scores": {r["name"]: _number(r["value"]) for r in report["table"]},
    }
    with record.open("a") as out:
        out.write(json.dumps(line, ensure_ascii=False) + "\n")
    page.write_text(rendered(record))


def _number(value: float) -> float | None:
    return None if math.isnan(value) else round(value, 4)


def rendered(record: Path = RECORD) -> str:
    """The page for a record, which may be absent or empty."""
    rows = []
    text = record.read_text() if record.exists() else ""
    for line in text.splitlines():
        entry = json.loads(line)
        scores = "; ".join(f"{n} {v}" for n, v in entry["scores"].items() if v is not None)
        rows.append(
            f"| {entry['opened']} | {entry['commit']} | {entry['key_sha256'][:12]} "
            f"| {entry['verdicts_sha256'][:12]} | {entry['answered']}/{entry['cases']} "
            f"| {scores} |\n"
        )
    return HEAD + ("".join(rows) or "| not opened yet | | | | | |\n")
