"""Whether an answer hangs on the length of a cell, which nothing but habit has set."""

from __future__ import annotations

from dataclasses import replace

from smad.gap.compare.select import Selection, weighed
from smad.gap.fit.hypothesis import Hypothesis, acceptable
from smad.gap.fit.lsq import Problem

_FACTORS = (0.5, 2.0)


def hangs_on_cells(selection: Selection, *, tied: bool) -> str:
    """A sentence on the causes that would enter, or would not, with other cells; "" for none.

    Nothing is fitted again: the same predictions are scored in cells half and twice as long.
    """
    block_s = selection.base.fit.problem.dataset.settings.block_s
    told = []
    for factor in _FACTORS:
        lost, new = _changed(selection, factor * block_s, tied=tied)
        said = [f"{', '.join(names)} would {verb}enter"
                for names, verb in ((lost, "not "), (new, "")) if names]  # fmt: skip
        if said:
            told.append(f"in cells of {factor * block_s:g} s {' and '.join(said)}")
    if not told:
        return ""
    return f"{'; '.join(told)}: the answer hangs on the length of the cells, {block_s:g} s"


def _changed(selection: Selection, block_s: float, *, tied: bool) -> tuple[list[str], list[str]]:
    """Causes that entered and would not with such cells; without any, one that would."""
    steps = selection.steps
    if steps:
        before = (selection.base, *steps[:-1])
        kept = [_enters(b, c, block_s, tied=tied) for b, c in zip(before, steps, strict=True)]
        return [c.names[-1] for c, stays in zip(steps, kept, strict=True) if not stays], []
    settings = selection.base.fit.problem.dataset.settings
    refused = [c for c in selection.tried if not acceptable(c, settings, tied=tied)]
    new = (c for c in refused if _enters(selection.base, c, block_s, tied=tied))
    return [], [c.names[-1] for c in new][:1]


def _enters(before: Hypothesis, candidate: Hypothesis, block_s: float, *, tied: bool) -> bool:
    old, new = _in_cells(before, block_s), _in_cells(candidate, block_s)
    again = weighed(old, new.joint, new.judged)
    return acceptable(again, new.fit.problem.dataset.settings, tied=tied)


def _in_cells(c: Hypothesis, block_s: float) -> Hypothesis:
    def recut(problem: Problem) -> Problem:
        return replace(problem, dataset=problem.dataset.with_cells_of(block_s))

    judged = replace(
        c.judged,
        problem=recut(c.judged.problem),
        hold=None if c.judged.hold is None else recut(c.judged.hold),
    )
    fit = replace(c.fit, problem=recut(c.fit.problem))
    return replace(c, joint=replace(c.joint, fit=fit), judged=judged)
