"""The rows of a gap with the responses of all places, in white space."""

from __future__ import annotations

import numpy as np

from smad.diagnosis.gap import Gap
from smad.diagnosis.numerics.folds import FoldRows
from smad.diagnosis.places.responses import Responses


def fold_rows(gap: Gap, found: Responses, only: tuple[bool, ...] | None = None) -> FoldRows:
    """White rows of a gap with the responses of every term.

    With `only`, every response stands twice: as it is, and for the runs marked alone.
    """
    count = len(found.runs[0])
    copies = 1 if only is None else 2
    responses = np.zeros((copies * count, len(gap.z)), dtype=np.float32)
    # A law at a time: all in double precision would be a gigabyte.
    for own in found.columns:
        raw = [found.runs[k][own.start : own.stop].astype(np.float64) for k in gap.kind_of_run]
        responses[own.start : own.stop] = gap.rows(raw)
        if only is not None:
            part = [r if mine else np.zeros_like(r) for r, mine in zip(raw, only, strict=True)]
            responses[count + own.start : count + own.stop] = gap.rows(part)
    return FoldRows(gap.z, responses, gap.fold, found.runs[0].shape[2])
