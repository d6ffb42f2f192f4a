"""Scores of a bank as they are published: goals, curves, simpler rules; a sealed key is logged."""

from __future__ import annotations

import datetime
from collections.abc import Sequence
from pathlib import Path

from smad.errors import SmadError
from smad.gap.check.key import SEALED, file_digest, read_key
from smad.gap.check.running import commit
from smad.gap.check.score import matched, write_scores
from smad.gap.check.verdicts import read_verdicts
from smad.gap.sma import SmaPlant
from smad.report.page import write_page
from tests.withheld.baselines import told_beside
from tests.withheld.errors import WithheldError
from tests.withheld.openings import Ledger, checkout
from tests.withheld.places import into_document
from tests.withheld.score_page import page, text
from tests.withheld.scores import Published, published


def run(
    verdicts: Path,
    key: Path,
    *,
    kept: Path | None = None,
    json_path: Path | None = None,
    html_path: Path | None = None,
    documents: Sequence[Path] = (),
    answered_only: bool = False,
) -> Published:
    """Print and write the scores. A sealed key is refused unless its hash was committed before, and
    its use is entered in docs/withheld-openings.md.

    Raises WithheldError when verdicts and key do not belong together, and for such a key.
    """
    try:
        file = read_verdicts(verdicts)
        truth, key_sha256 = read_key(key)
        pairs = matched(file, truth, key_sha256, answered_only=answered_only)
        ledger = Ledger.of(checkout())
        if truth.bank == SEALED:
            ledger.require_sealed(key_sha256)
        library = [e.name for e in SmaPlant().effects]
        beside = told_beside(verdicts, [p.case for p in pairs], kept, library)
        result = published(pairs, truth.bank, beside)
        if truth.bank == SEALED:
            now = datetime.datetime.now(datetime.UTC)
            ledger.enter(key_sha256, file_digest(verdicts), result, commit=commit(), now=now)
        print(text(result))
        if json_path is not None:
            write_scores(json_path, result)
        if html_path is not None:
            facts = [(n, str(file.tool[n])) for n in ("version", "commit") if file.tool.get(n)]
            write_page(page(result, facts), html_path)
        for document in documents:
            into_document(document, result)
    except SmadError as error:
        raise WithheldError(str(error)) from error
    return result
