"""Scores of a bank as they are published; the use of a sealed key is logged."""

from __future__ import annotations

import datetime
from pathlib import Path

from evaluation.errors import WithheldError
from evaluation.results.record import keep
from evaluation.score.baselines import told_beside
from evaluation.score.openings import Ledger
from evaluation.score.scores import Published, published
from evaluation.score.tables import tables, text
from smad.diagnosis.bank.key import SEALED, file_digest, read_key
from smad.diagnosis.bank.running import commit
from smad.diagnosis.bank.score import matched
from smad.diagnosis.bank.verdicts import read_verdicts
from smad.diagnosis.spring_pair import SmaPlant
from smad.errors import SmadError


def run(
    verdicts: Path,
    key: Path,
    *,
    diagnoses: Path | None = None,
    out: Path | None = None,
    title: str = "",
    note: str = "",
    answered_only: bool = False,
) -> Published:
    """Print the scores; with `out` keep them as a result. A sealed key is refused unless its hash
    was committed before, and its use is entered in the log of openings.

    Raises WithheldError when verdicts and key do not belong together, and for such a key.
    """
    try:
        file = read_verdicts(verdicts)
        truth, key_sha256 = read_key(key)
        pairs = matched(file, truth, key_sha256, answered_only=answered_only)
        if truth.bank == SEALED:
            Ledger.of().require_sealed(key_sha256)
        library = [e.name for e in SmaPlant().effects]
        beside = told_beside(verdicts, [p.case for p in pairs], diagnoses, library)
        result = published(pairs, truth.bank, beside)
        if truth.bank == SEALED:
            now = datetime.datetime.now(datetime.UTC)
            Ledger.of().enter(key_sha256, file_digest(verdicts), result, commit=commit(), now=now)
    except SmadError as error:
        raise WithheldError(str(error)) from error
    print(text(result))
    if out is not None:
        keep(out, tables(result), title=title, command="python -m evaluation score", note=note)
    return result
