"""Scores of a bank as they are published; the use of a sealed key is logged."""

from __future__ import annotations

import datetime
from pathlib import Path

from evaluation.checkout import commit
from evaluation.results.record import keep
from evaluation.score.answers import digest, read_pairs, source_of
from evaluation.score.openings import SEALED, Ledger
from evaluation.score.scores import scored, tables
from smad.report.page import Table
from smad.view.terminal.tables import print_table


def run(
    verdicts: Path,
    key: Path,
    *,
    out: Path | None = None,
    title: str = "",
    note: str = "",
    answered_only: bool = False,
) -> dict[str, Table]:
    """Keep the scores in `out` if given, and print them. A sealed key is refused unless its hash
    was entered before and it was never opened; its use is entered in the log of openings.

    Raises WithheldError when answers and key do not belong together, and for such a key.
    """
    truth, pairs = read_pairs(verdicts, key, answered_only=answered_only)
    ledger = Ledger.of()
    if truth.bank == SEALED:
        ledger.require_sealed(digest(key))
    by_heading = tables(pairs)
    if truth.bank == SEALED:
        now = datetime.datetime.now(datetime.UTC)
        ledger.enter(
            digest(key),
            digest(verdicts),
            scored(pairs),
            cases=len(pairs),
            commit=commit(),
            source_sha256=source_of(verdicts),
            now=now,
        )
    # A sealed key is scored once: the table is kept before a closed pipe can end the command.
    if out is not None:
        command = "python -m evaluation score" + " --answered-only" * answered_only
        keep(out, by_heading, title=title, command=command, note=note)
    for heading, table in by_heading.items():
        print(heading)
        print_table(table)
        print()
    return by_heading
