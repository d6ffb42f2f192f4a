"""Published scores as tables, and as a text for the terminal."""

from __future__ import annotations

from collections.abc import Mapping

from evaluation.score.scores import Published
from smad.diagnosis.bank.names import CAUSES
from smad.diagnosis.bank.score import mistakes_table, number
from smad.report.page import Table, text_table

_MET = {True: "yes", False: "no", None: ""}
_QUIET = {"none": "no_gap", "parameters": "parameters_only"}


def tables(scores: Published) -> dict[str, Table]:
    """Everything that is scored, by heading; what the scores have nothing of is left out."""
    found = {
        "Scores": table(scores),
        "By strength": _by_strength(scores),
        "Simpler rules on the same data": beside(scores),
        "Calibration": _calibration(scores),
        "What was said of what": _confusion(scores),
        "What the model is trusted to, in floors": _trusted(scores),
        "What differs between model and bench": _compared(scores),
        "Wrong first answers": mistakes_table(scores.mistakes),
    }
    return {heading: shown for heading, shown in found.items() if shown.rows}


def text(scores: Published) -> str:
    """The scores for a terminal."""
    parts = [f"{scores.answered} of {scores.cases} cases answered\n", text_table(table(scores))]
    others = beside(scores)
    if others.rows:
        parts += ["\nbaselines on the same data\n", text_table(others)]
    return "\n".join(p.rstrip("\n") for p in parts)


def table(scores: Published) -> Table:
    """The table of scores with its goals."""
    return Table(
        ("score", "value [95 %]", "cases", "goal", "met"),
        [(r.name, number(r), str(r.count), r.goal, _MET[r.met]) for r in scores.table],
        numeric=frozenset({1, 2}),
    )


def beside(scores: Published) -> Table:
    """The diagnosis and simpler rules side by side; no rows where no rule was handed in."""
    names = list(scores.baselines)
    first = scores.baselines[names[0]] if names else []
    rows = [
        (row.name, *(number(scores.baselines[n][i]) for n in names)) for i, row in enumerate(first)
    ]
    return Table(("score", *names), rows, numeric=frozenset(range(1, 1 + len(names))))


def _by_strength(scores: Published) -> Table:
    labels = [row.name for row in next(iter(scores.by_strength.values()), [])]
    rows = [(score, *map(number, own)) for score, own in scores.by_strength.items()]
    return Table(("score", *labels), rows, numeric=frozenset(range(1, 1 + len(labels))))


def _calibration(scores: Published) -> Table:
    rows = [(f"{b.said:.2f}", f"{b.was:.2f}", str(b.count)) for b in scores.calibration]
    return Table(("probability said", "share right", "cases"), rows, numeric=frozenset({0, 1, 2}))


def _confusion(scores: Published) -> Table:
    """What was said of every truth, and how often; the most frequent answer first."""
    rows = [
        (truth, _right(truth), ", ".join(_counted(scores.confusion[truth])))
        for truth in sorted(scores.confusion, key=_place)
    ]
    return Table(("truth", "right answer", "said (cases)"), rows)


def _place(truth: str) -> tuple[int, int, str]:
    if truth in CAUSES:
        return 1, CAUSES.index(truth), truth
    return (0, 0, truth) if truth in _QUIET else (2, 0, truth)


def _right(truth: str) -> str:
    return "unknown" if truth.startswith("unknown: ") else _QUIET.get(truth, truth)


def _counted(said: Mapping[str, int]) -> list[str]:
    return [f"{name} ({n})" for name, n in sorted(said.items(), key=lambda x: (-x[1], x[0]))]


def _trusted(scores: Published) -> Table:
    """What the model is trusted to on each channel, in floors."""
    rows = [
        (t.channel, *(f"{x:.1f}" for x in (t.low, t.median, t.high)), str(t.cases))
        for t in scores.trusted
    ]
    heads = ("channel", "quartile", "median", "quartile", "cases")
    return Table(heads, rows, numeric=frozenset({1, 2, 3, 4}))


def _compared(scores: Published) -> Table:
    """Cases without known-good runs; the first cause of the budget is the answer."""
    rows = [
        (c.case, " + ".join(c.truth) or "none", c.outcome, c.said, _budget(c.budget))
        for c in scores.model_against_bench
    ]
    return Table(("case", "added", "outcome", "said", "budget"), rows)


def _budget(budget: Mapping[str, float]) -> str:
    return ", ".join(f"{name} {part:.0%}" for name, part in budget.items()) or "none"
