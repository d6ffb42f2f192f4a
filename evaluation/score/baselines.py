"""What simpler rules would have said, from the models that one diagnosis fitted anyway.

They choose among the refit alone ("none") and every set of effects that was fitted jointly: single
effects of the short list, and the sets that the selection tried. Effects that only the screening
saw have no joint fit and are left out, which favours the baselines. None of them can say unknown.
"""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Mapping, Sequence
from pathlib import Path

import msgspec
import numpy as np
from scipy.stats import chi2
from smad.gap.records import Diagnosis, FittedRecord

from smad.diagnosis.bank.names import canonical
from smad.diagnosis.bank.verdicts import Short

_PASSES = 0.95


def told_beside(
    verdicts: Path, cases: Sequence[str], kept: Path | None, library: Sequence[str]
) -> Mapping[str, Mapping[str, Short]]:
    """What simpler rules say of each case, in the bank's names.

    A verdict file of check-ups tells it itself; of others it is found from the whole diagnoses that
    `smad gap check --keep` wrote into `kept`.
    """
    file = json.loads(verdicts.read_bytes())["verdicts"]
    own = {c: v["baselines"] for c, v in file.items() if v.get("baselines")}
    found = msgspec.convert(own, dict[str, dict[str, Short]])
    for case in cases:
        path = kept / f"{case}.json" if kept is not None else None
        if path is not None and path.is_file():
            fitted = Diagnosis.from_json(path.read_bytes()).fitted
            found[case] = baselines(fitted, library, case)
    return {
        case: {rule: Short(s.outcome, [canonical(n) for n in s.names]) for rule, s in rules.items()}
        for case, rules in found.items()
    }


def baselines(fitted: Sequence[FittedRecord], library: Sequence[str], case: str
              ) -> dict[str, Short]:  # fmt: skip
    """Baseline verdicts by name; none but the random one without a fit."""
    out = {"random": _random(library, case)}
    if not fitted:
        return out
    return out | {
        "smallest_rmse": _said(min(fitted, key=lambda f: f.held_out)),
        "bic_only": _said(min(fitted, key=_bic)),
        "chi2_only": _said(_chi2(fitted)),
    }


def _said(f: FittedRecord) -> Short:
    return Short("effect", list(f.names)) if f.names else Short("no_gap")


def _bic(f: FittedRecord) -> float:
    """Schwarz's criterion with the robust likelihood of the fit runs (Schwarz 1978)."""
    return 2.0 * f.objective + f.parameters * math.log(f.rows)


def _chi2(fitted: Sequence[FittedRecord]) -> FittedRecord:
    """The smallest χ², if it is smaller by more than its extra parameters explain at 95 %."""
    refit = next(f for f in fitted if not f.names)
    best = min(fitted, key=lambda f: f.chi2)
    extra = best.parameters - refit.parameters
    if extra < 1 or refit.chi2 - best.chi2 <= chi2.ppf(_PASSES, extra):
        return refit
    return best


def _random(library: Sequence[str], case: str) -> Short:
    """One of none, unknown and every effect, all as likely; the case's name is the seed."""
    seed = int.from_bytes(hashlib.sha256(case.encode()).digest()[:8], "big")
    pick = int(np.random.default_rng(seed).integers(len(library) + 2))
    if pick < len(library):
        return Short("effect", [sorted(library)[pick]])
    return Short("no_gap" if pick == len(library) else "unknown")
