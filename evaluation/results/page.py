"""`README.md` of this folder from the kept results and the log of openings.

python -m evaluation.results.page [--check]
"""

from __future__ import annotations

import json
import sys
from pathlib import Path

from evaluation.results.record import FOLDER, Result, kept
from smad.report.page import Table, markdown_table

PAGE = Path(__file__).parent / "README.md"
OPENINGS = FOLDER / "openings.jsonl"
_HEAD = """# Results of the evaluation

Made by `python -m evaluation results` from `evaluation/results`, which also has the tables that
are too long for a page. How the cases are made, what a floor is and what each row counts is in
[the evaluation](../README.md). Every figure is about the independent plant's family of simulated
benches, until a real bench says otherwise.
"""
_LOG = """
## Openings

One line for each use of the key of a sealed bank. Nothing may be tuned on what these lines say.

"""
_MOST_WORDS = 450
"""A larger first table is read in its file, as all others are."""
_COLUMNS = {
    "false alarms": ("check-up: quiet benches called changed", "false alarms on none"),
    "noticed at 3 floors": ("check-up: noticed near 3 floors", "detected at 3× the floor"),
    "at 10": ("check-up: noticed near 10 floors", "detected at 10× the floor"),
    "place right first": ("check-up: place right first, listed",),
    "right name": ("check-up: right name, of noticed listed", "right name first, of the detected"),
    "unknown given a name": (
        "check-up: unlisted given a name", "unknown effects named as a known one",
    ),
}  # fmt: skip
"""Heads of the page's columns and what they show, as the log calls it now or did before."""


def rendered(results: list[Result], openings: Path = OPENINGS) -> str:
    """The page."""
    return _HEAD + "".join(map(_section, results)) + _LOG + markdown_table(_openings(openings))


def _section(result: Result) -> str:
    parts = [
        f"\n## {result.title}\n",
        f"Measured {result.date} at commit {result.commit} with `{result.command}`.\n",
        *(f"{note}\n" for note in result.notes),
    ]
    heading, first = next(iter(result.tables.items()))
    shown = markdown_table(first)
    if len(shown.split()) <= _MOST_WORDS:
        parts += [*([f"**{heading}**\n"] if heading else []), shown]
    return "\n".join(parts)


def _openings(path: Path) -> Table:
    """A row for each opening, the newest last."""
    lines = path.read_text().splitlines() if path.exists() else []
    rows = []
    for entry in map(json.loads, lines):
        scores = (_first(entry["scores"], names) for names in _COLUMNS.values())
        rows.append(
            (
                entry["opened"],
                entry["commit"],
                entry["key_sha256"][:12],
                str(entry["cases"]),
                *("–" if value is None else f"{value:.2f}" for value in scores),
            )
        )
    head = ("opened (UTC)", "commit", "key", "cases", *_COLUMNS)
    return Table(head, rows, numeric=frozenset(range(3, len(head))))


def _first(scores: dict[str, float | None], names: tuple[str, ...]) -> float | None:
    return next((scores[n] for n in names if n in scores), None)


def main(arguments: list[str]) -> int:
    """Write the page; with `--check` say whether it is stale, and end with status 1 if so."""
    text = rendered(kept())
    if "--check" not in arguments:
        PAGE.write_text(text)
        return 0
    if PAGE.exists() and PAGE.read_text() == text:
        return 0
    sys.stderr.write(f"{PAGE.name} is stale: run python -m evaluation results\n")
    return 1


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
