"""The budget as a table, and the terms of the report's page."""

from __future__ import annotations

from collections.abc import Sequence

from smad.gap.records import Budget, RunAgreement
from smad.report.page import Table

TERMS = (
    ("noise floor", "what a signal scatters by when nothing moves, and what its last digit hides; "
     "with known-good runs also what the model is already wrong by"),
    ("gap", "how far simulation and bench are apart: the root of the mean square error beyond the "
     "noise floor, in floors; over all signals the root of the mean of their squares"),
    ("refit", "other values of the parameters that the model has anyway, within their bounds"),
    ("cause, effect", "an entry of the library: something that a bench may have and the model "
     "lacks, with a strength"),
    ("runs held out", "runs that nothing was fitted to; without them each run is predicted by a "
     "fit to the others"),
    ("S, shrink", "the share of the refitted gap that goes with the cause"),
    ("ceiling", "the share that a curve fitted freely to the measured state takes: it names no "
     "cause, and shows how much any could explain"),
    ("probability", "of the named cause among those of the library and none, for these runs"),
    ("fit interval", "what the scatter of these runs leaves open at the 95 % level; errors of the "
     "model's form, its steps and the sensors are not in it, so it may be too narrow"),
    ("gain", "by how much the logarithm of the likelihood of runs held out rises; one unit of it "
     "is a nat"),
    ("cell", "a stretch of a few seconds of one signal, whose scale is judged as a whole"),
    ("masked", "the share of what an effect does that other values of the parameters imitate"),
    ("visible", "what is left of an effect of typical strength then, in floors"),
    ("d²", "how far two explanations are apart in these or other runs, in squared standard errors"),
    ("profile", "how much worse the best fit becomes when one value is held elsewhere"),
    ("open loop, local", "the whole simulator fed with recorded inputs only; each part of it fed "
     "with what was measured of its neighbours"),
    ("regime", "what the bench was doing: heating, cooling with the pump, reversal, rest"),
    ("Ljung–Box", "a test for what is left in a residual: small p means that it is not mere noise"),
)  # fmt: skip


def budget_table(budget: Budget, caption: str = "") -> Table:
    """All signals first, then each that has a gap."""
    header = ("signal", "gap at first", "parameters", *budget.causes, "rest", "gap at last")
    rows = [
        (
            row.signal or "all",
            f"{row.raw:.2f}×",
            *(_share(x) for x in (row.parameters, *row.causes, row.rest)),
            f"{row.left:.2f}×",
        )
        for row in budget.rows
        if not row.signal or max(row.raw, row.left) >= _SHOWN
    ]
    return Table(header, rows, caption, frozenset(range(1, len(header))))


def agreement_table(
    runs: Sequence[RunAgreement],
) -> tuple[Sequence[str], Sequence[Sequence[str]]]:
    """Header and rows of the gap by run; runs that contradict the others are marked."""
    rows = [
        (r.run, f"{r.gap:.2f}×", "contradicts the others" if r.contradicts else "") for r in runs
    ]
    return ("run", "gap at first", ""), rows


_SHOWN = 0.35
_HIDDEN = 0.01


def with_unit(value: str, unit: str) -> str:
    """A number as it is told: a pure one has no unit."""
    return value if unit in ("", "1") else f"{value} {unit}"


def _share(share: float) -> str:
    return f"{share:.0%}".replace("-0%", "0%")


def budget_remarks(budget: Budget) -> Sequence[str]:
    """What the table does not say by itself."""
    out = []
    if budget.causes and not budget.named:
        out.append(f"{', '.join(budget.causes)}: the best of the library, not named.")
    if budget.causes and not budget.parameters:
        said = "With the cause, the parameters can stay as they were: other values are not needed."
        if budget.alone > _HIDDEN:
            said += f" Without it, other values would hide {budget.alone:.0%} of the gap."
        out.append(said)
    if budget.dominated_by and budget.median is not None:
        m = budget.median
        out.append(
            f"{budget.dominated_by} carries {budget.dominating:.0%} of the squared gap after the "
            f"parameters; in the median run it falls from {m.raw:.1f}× over {m.refit:.1f}× to "
            f"{m.final:.1f}×."
        )
    return out
