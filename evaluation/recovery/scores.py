"""Scores of the recovery bank.

If other values of the parameters leave at most `AT_FLOOR` floors of the judged runs, alone or with
one effect of a pair, these runs cannot show the rest. Every share is given twice: of all cases, and
without those.
"""

from __future__ import annotations

import statistics
from collections.abc import Callable, Sequence

from evaluation.recovery.cases import NONE, PAIR, QUESTIONS, SINGLE, THIRD
from evaluation.recovery.cases import PARAMETERS as PARAMETERS_ALONE
from evaluation.recovery.judging import Answer
from evaluation.score.goals import Goal
from evaluation.score.scores import number, share
from smad.diagnosis.verdict import AT_FLOOR, CHECK_UP, PARAMETERS, QUIET, REFUSED, SignalGap
from smad.report.page import Table

Test = Callable[[Answer], bool]


def first_name(answer: Answer) -> str:
    """The likeliest effect of the first step, reported or not; empty where none was asked."""
    if answer.verdict is None:
        return ""
    causes = answer.verdict.causes
    rivals = causes[0].rivals if causes else answer.verdict.rivals
    effects = [r for r in rivals if r.kind == "effect"]
    return max(effects, key=lambda r: r.probability).name if effects else ""


def reported_names(answer: Answer) -> set[str]:
    """The effects that are reported as causes."""
    return {c.name for c in answer.verdict.causes if c.name} if answer.verdict else set()


def outcome(answer: Answer) -> str:
    """The outcome; a case without a verdict counts as refused."""
    return answer.verdict.outcome if answer.verdict else REFUSED


def _whole(answer: Answer) -> SignalGap | None:
    return answer.verdict.whole if answer.verdict else None


def identifiable(answer: Answer) -> bool:
    """Whether other values of the parameters leave more than `AT_FLOOR` floors, alone and with one
    effect of a pair."""
    whole = _whole(answer)
    if whole is None or answer.verdict is None:
        return True
    first = answer.verdict.causes[:1] if answer.case.kind == PAIR else []
    of_pair = [c.gap for c in first if c.name in answer.case.effects]
    return min([whole.parameters, *of_pair]) >= AT_FLOOR


def first_right(answer: Answer) -> bool:
    """Whether the likeliest effect is one at work."""
    return first_name(answer) in answer.case.effects


def all_reported(answer: Answer) -> bool:
    """Whether every effect at work is reported."""
    return set(answer.case.effects) <= reported_names(answer)


def near(answer: Answer) -> bool:
    """Whether what is reported leaves at most `AT_FLOOR` floors."""
    whole = _whole(answer)
    return whole is not None and whole.final <= AT_FLOOR


def _foreign(answer: Answer) -> bool:
    """Whether anything is reported that is not at work: another effect, or a law."""
    causes = answer.verdict.causes if answer.verdict else []
    return any(c.name not in answer.case.effects for c in causes)


_ROWS: tuple[tuple[str, str, Test, Goal | None], ...] = (
    ("right name first", SINGLE, first_right, Goal(0.98)),
    ("right name reported", SINGLE, all_reported, Goal(0.95)),
    ("something else reported", SINGLE, _foreign, None),
    ("gap left at most 1.3 floors", SINGLE, near, Goal(0.95)),
    ("nothing called something", NONE, lambda a: outcome(a) != QUIET, Goal(0.02, at_most=True)),
    ("parameters called parameters", PARAMETERS_ALONE,
     lambda a: outcome(a) == PARAMETERS, Goal(0.95)),
    ("parameters given a cause", PARAMETERS_ALONE,
     lambda a: a.verdict is None or bool(a.verdict.causes), Goal(0.05, at_most=True)),
    ("pairs: one of both reported", PAIR,
     lambda a: bool(reported_names(a) & set(a.case.effects)), None),
    ("pairs: both reported", PAIR, all_reported, Goal(0.85)),
    ("pairs: gap left at most 1.3 floors", PAIR, near, None),
)  # fmt: skip
_LONGEST_S = {question: 8.0 if question == CHECK_UP else 20.0 for question in QUESTIONS}


def tables(answers: Sequence[Answer]) -> dict[str, Table]:
    """The tables by heading, for each question that was asked."""
    out: dict[str, Table] = {}
    for question in QUESTIONS:
        part = [a for a in answers if a.case.question == question]
        out[f"Recovery, {question}"] = _scores(part, question)
        out[f"Recovery, {question}: single effects apart"] = _apart(part)
        out[f"Recovery, {question}: wrong, missed or indistinguishable"] = _wrong(part)
    return {heading: table for heading, table in out.items() if table.rows}


def _scores(answers: Sequence[Answer], question: str) -> Table:
    lines = []
    for name, kind, test, goal in _ROWS:
        part = [a for a in answers if a.case.kind == kind]
        if not part:
            continue
        clear = [a for a in part if identifiable(a)] if kind in (SINGLE, PAIR) else part
        rows = share(name, part, test), share(name, clear, test)
        met = (
            " / ".join(
                "–" if r.value is None else "yes" if goal.met(r.value) else "no" for r in rows
            )
            if goal
            else ""
        )
        cells = (x for r in rows for x in (number(r), str(r.count)))
        lines.append((name, *cells, str(goal or ""), met))
    seconds = [a.cpu_s for a in answers if a.verdict]
    if seconds:
        most, bound = max(seconds), _LONGEST_S[question]
        middle = f"{statistics.median(seconds):.1f} (most {most:.1f})"
        met = "yes" if most <= bound else "no"
        lines.append(("processor time in s, median", middle, str(len(seconds)), "", "",
                      f"≤ {bound:g}", met))  # fmt: skip
    head = (
        "score", "all [95 %]", "cases", "identifiable [95 %]", "cases", "goal", "met: all / id."
    )  # fmt: skip
    return Table(head, lines, numeric=frozenset({1, 2, 3, 4}))


def _apart(answers: Sequence[Answer]) -> Table:
    """Single effects by strength, parameters and side."""
    groups: list[tuple[str, Test]] = [
        ("typical strength", lambda a: a.case.strength > THIRD),
        ("a third of it", lambda a: a.case.strength == THIRD),
        ("nominal parameters", lambda a: a.case.bench == 0),
        ("moved parameters", lambda a: a.case.bench != 0),
        ("both springs", lambda a: a.case.side == "both"),
        ("X alone", lambda a: a.case.side == "x"),
    ]
    lines = []
    for name, belongs in groups:
        part = [a for a in answers if a.case.kind == SINGLE and belongs(a)]
        if part:
            clear = [a for a in part if identifiable(a)]
            cells = (number(share("", clear, test)) for test in (first_right, all_reported, near))
            lines.append((name, str(len(part)), str(len(part) - len(clear)), *cells))
    head = ("of single effects", "cases", "indistinguishable", "right name first", "reported",
            "at most 1.3 floors left")  # fmt: skip
    return Table(head, lines, numeric=frozenset(range(1, len(head))))


def _right(answer: Answer) -> bool:
    if answer.case.kind == NONE:
        return outcome(answer) == QUIET
    if answer.case.kind == PARAMETERS_ALONE:
        return outcome(answer) == PARAMETERS
    return all_reported(answer) and near(answer) and not _foreign(answer)


def _wrong(answers: Sequence[Answer]) -> Table:
    """Cases that are not answered as they should be, with the gaps that say why."""
    lines = []
    for a in sorted(answers, key=lambda a: a.case.name):
        if _right(a):
            continue
        whole = _whole(a)
        gaps = " → ".join(
            f"{x:.1f}" for x in ((whole.raw, whole.parameters, whole.final) if whole else ())
        )
        causes = ", ".join(
            c.name or f"law: {c.place}" for c in (a.verdict.causes if a.verdict else [])
        )
        lines.append(
            (
                a.case.name,
                outcome(a),
                causes or a.error,
                first_name(a),
                gaps,
                "" if identifiable(a) or not a.case.effects else "no",
            )
        )
    gaps = "raw → parameters → reported, floors"
    head = ("case", "outcome", "reported", "likeliest effect", gaps, "identifiable")
    return Table(head, lines)
