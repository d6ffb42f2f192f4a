"""`README.md` of this folder from the kept results and the log of openings, and what docs/trust.md
shows of the probabilities.

python -m evaluation.results.page [--check]
"""

from __future__ import annotations

import json
import sys
from pathlib import Path

import msgspec

from evaluation.results.record import FOLDER, Result, all_results
from smad.report.page import Table

PAGE = Path(__file__).parent / "README.md"
OPENINGS = FOLDER / "openings.jsonl"
TRUST = Path(__file__).parents[2] / "docs" / "trust.md"
CALIBRATION = "calibration.json"
"""What `calibrate --result` keeps: how often what had a probability was right."""
_BEGIN, _END = "<!-- reliability -->", "<!-- end of reliability -->"
_BARS = 20
_RELIABILITY = """## The probabilities

How often the likeliest place and the likeliest effect were right, by their stated probability,
in noticed development cases, many of them of our own simulator.
{of}
"""
_HEAD = """# Results of the evaluation

Made by `python -m evaluation results` from `evaluation/results`, which also has the tables that
are too long for a page. How the cases are made, what a floor is and what each row counts is in
[the evaluation](../README.md). Every figure is of simulated benches: the independent plant's, but
for control and a part of the development cases, which are of smad's own simulator. Each result
names the commit that measured it; a sealed bank's was scored by that commit and judged by the one
of its note. Later code may score otherwise.
"""
_LOG = """
## Openings

One line for each use of the key of a sealed bank, with the commit that scored. Nothing may be tuned
on what these lines say.

"""
_MOST_WORDS = 600
"""A larger first table is read in its file, as all others are."""
_COLUMNS = {
    "false alarms": ("check-up: quiet benches called changed", "false alarms on none"),
    "noticed at 3 floors": ("check-up: noticed near 3 floors", "detected at 3× the floor"),
    "at 10": ("check-up: noticed near 10 floors", "detected at 10× the floor"),
    "place right first": ("check-up: place right first, listed",),
    "right name": (
        "check-up: right name reported, of noticed listed",
        "check-up: right name told, of noticed listed", "check-up: right name, of noticed listed",
        "right name first, of the detected",
    ),
    "unknown given a name": (
        "check-up: unlisted reported by name",
        "check-up: unlisted told by name", "check-up: unlisted given a name",
        "unknown effects named as a known one",
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
    text = markdown_table(first)
    if len(text.split()) <= _MOST_WORDS:
        parts += [*([f"**{heading}**\n"] if heading else []), text]
    return "\n".join(parts)


def markdown_table(table: Table) -> str:
    """The table as Markdown."""
    columns = range(len(table.header))
    rule = ["---:" if k in table.numeric else "---" for k in columns]
    rows = ["| " + " | ".join(row) + " |" for row in (table.header, *table.rows)]
    return "\n".join([rows[0], f"|{'|'.join(rule)}|", *rows[1:]]) + "\n"


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


def with_reliability(text: str, result: Result | None) -> str:
    """The page of trust with the reliability diagrams of a result between its two marks.

    Without marks, or without a result, it stays as it is.
    """
    before, begin, rest = text.partition(_BEGIN)
    _, end, after = rest.partition(_END)
    if result is None or not begin or not end:
        return text
    parts = [_RELIABILITY.format(of=" ".join(result.notes))]
    for heading, table in result.tables.items():
        if heading.startswith("Probability"):
            head = (heading, "right [95 %]", "cases", "right")
            rows = [(*row, _bar(row[1])) for row in table.rows]
            parts.append(markdown_table(Table(head, rows, numeric=frozenset({0, 1, 2}))))
    return before + begin + "\n\n" + "\n".join(parts) + "\n" + end + after


def _bar(share: str) -> str:
    """A bar as long as the share that a cell begins with."""
    full = round(float(share.partition(" ")[0]) * _BARS)
    return "█" * full + "·" * (_BARS - full)


def _calibration(folder: Path = FOLDER) -> Result | None:
    path = folder / CALIBRATION
    return msgspec.json.decode(path.read_bytes(), type=Result) if path.exists() else None


def main(arguments: list[str]) -> int:
    """Write the pages; with `--check` say whether they are stale, and end with status 1 if so."""
    pages = {PAGE: rendered(all_results())}
    if TRUST.exists():
        pages[TRUST] = with_reliability(TRUST.read_text(), _calibration())
    stale = [p for p, text in pages.items() if not p.exists() or p.read_text() != text]
    if "--check" not in arguments:
        for path in stale:
            path.write_text(pages[path])
        return 0
    for path in stale:
        sys.stderr.write(f"{path.name} is stale: run python -m evaluation results\n")
    return 1 if stale else 0


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
