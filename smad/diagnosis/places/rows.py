"""The rows of a check-up with the responses of all places, in white space."""

from __future__ import annotations

import numpy as np

from smad.diagnosis.numerics.folds import FoldRows, Index
from smad.diagnosis.places.responses import Responses
from smad.gap.paired.difference import Paired

_FOLDS = 4
"""As many runs, or fewer of which each is in all folds by turns."""
_TURNS = 2


def fold_rows(pairs: Paired, found: Responses) -> FoldRows:
    """White rows of now − then beside tied parameters; a fold is a run, or every fourth
    stretch of few runs.

    Runs whose inputs the model carried over are in no fold: responses are of the good run's inputs.
    """
    white = pairs.white
    count = len(found.runs[0])
    responses = np.zeros((count, len(pairs.z)), dtype=np.float32)
    names = [r.name for r in pairs.reference.runs]
    number = [names.index(p.reference.name) for p in pairs.pairs]
    # A law at a time: all in double precision would be a gigabyte.
    for own in found.columns:
        raw = [found.runs[k][own.start : own.stop].astype(np.float64) for k in number]
        responses[own.start : own.stop] = pairs.tie(white(raw))
    return FoldRows(pairs.z, responses, _folds(pairs))


def _folds(pairs: Paired) -> Index:
    run = pairs.white.run_of_row()
    kept = [k for k, p in enumerate(pairs.pairs) if not p.carried]
    fold = np.full(len(run), -1, dtype=np.intp)
    for n, k in enumerate(kept):
        at = np.flatnonzero(run == k)
        block = (np.arange(len(at)) * _FOLDS * _TURNS) // len(at)
        fold[at] = n if len(kept) >= _FOLDS else block % _FOLDS
    fold[~pairs.white.valid] = -1
    return fold
