"""Inputs that look recorded one row early or late.

A row's inputs are those of the interval that ends at its time. Where a recorder writes what it has
just sent, they act in the next interval instead, and a drive looks slow. So each model that a part
was added to is fitted again, to the runs with all inputs moved by a row. If that is likelier than
every rival of the step, the record is in doubt rather than the simulator.
"""

import numpy as np

from smad.diagnosis.questions import AdmittedRuns
from smad.diagnosis.rivals.fit import reference_at
from smad.diagnosis.rivals.rival import Question, Rival
from smad.diagnosis.rivals.score import NOTHING
from smad.diagnosis.rivals.search import Search
from smad.diagnosis.runs import GapRun

_MOVES = {
    1: ("early", 'move their columns a row down, or say `inputs_act = "after"` in a map'),
    -1: ("late", "move their columns a row up"),
}
"""Rows down to move inputs by: how they stand in the record, and what to do."""


def moved_inputs(admitted: AdmittedRuns, search: Search) -> str:
    """A question about inputs that look recorded a row early or late; empty without such a doubt.

    `search` is that for what the simulator lacks, in which the parameters are free.
    """
    if not search.parts:
        return ""
    questions = [_with_moved_inputs(admitted, search, rows) for rows in _MOVES]
    before = search.parameters
    for step in search.steps:
        if step.entered is None:
            break
        for question, (words, remedy) in zip(questions, _MOVES.values(), strict=True):
            moved = _fitted_again(question, search, before)
            if moved is None or search.question.ranked([*step.rivals, moved])[0].fit != moved.fit:
                continue
            model = " and ".join(["other values of the parameters", *(p.name for p in moved.parts)])
            left, unmoved = (f"{search.question.gap(r):.2g}" for r in (moved, before))
            return (
                f"all inputs are one row {words}? With {model} they leave {left} floors if they "
                f"are moved by a row, {unmoved} as they are. If so, {remedy}"
            )
        before = step.entered
    return ""


def _with_moved_inputs(admitted: AdmittedRuns, search: Search, rows: int) -> Question:
    """The question of a search about runs whose inputs are moved by so many rows."""
    fit, held_out = ([_moved(r, rows) for r in runs] for runs in (admitted.fit, admitted.held_out))
    return admitted.question(search.question.model.start, fit, held_out, admitted.floors)


def _fitted_again(question: Question, search: Search, before: Rival) -> Rival | None:
    """The model of a rival, fitted to the runs of another question.

    None where the model fails, or where it predicts these runs worse than those it was fitted to.
    """
    fitted = before.fitted
    as_fitted = question.of_point(fitted.point)
    if as_fitted is None or as_fitted.scores.sum() <= before.scores.sum():
        return None
    # Parameters that imitated the move lead to a local minimum.
    start = np.r_[search.nominal.x, fitted.x[fitted.model.parameters :]]
    reference = reference_at(question.evidence, fitted.model, start)
    return None if reference is None else question.converged(NOTHING, NOTHING, reference)


def _moved(run: GapRun, rows: int) -> GapRun:
    """The run with every input as it was so many samples before (later, where negative)."""
    index = np.clip(np.arange(len(run.t_s)) - rows, 0, len(run.t_s) - 1)
    return run.with_columns(inputs={name: column[index] for name, column in run.inputs.items()})
