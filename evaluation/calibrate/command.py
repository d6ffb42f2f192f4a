"""`calibrate`: constants from development banks of both kinds, and what they are worth."""

from __future__ import annotations

import statistics
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from evaluation.calibrate.banks import cases_of
from evaluation.calibrate.fitting import (
    ALLOWED,
    HELD,
    Judged,
    fitted,
    noticed,
    whether,
    which,
)
from evaluation.calibrate.rivals import (
    LISTED,
    MOVED,
    NONE,
    UNLISTED,
    CaseRivals,
    Said,
    apart_from,
    folds_of,
    showing,
)
from evaluation.results.record import keep
from evaluation.score.scores import (
    calibration,
    calibration_of_equals,
    number,
    reliability,
    share,
)
from smad.diagnosis.constants import Constants, shipped
from smad.diagnosis.rivals.score import NOTHING, PARAMETERS
from smad.report.page import Table
from smad.view.terminal.tables import print_table

TITLE = "Constants by development banks, benches left out"
SCORES, PLACES, NAMES = "Scores", "Probability of the likeliest place", "Probability of the name"
"""Headings of the kept tables; the last two are shown in docs/trust.md."""
SaidBy = Sequence[tuple[Said, Constants]]
"""What constants make of cases."""
LEFT_OUT = "each bench, or effect of our simulator, by constants from the others"


def calibrate(
    files: Sequence[Path],
    keys: Sequence[Path],
    *,
    out: Path | None = None,
    result: Path | None = None,
) -> Constants:
    """The constants of cases: prints what the shipped ones, those of other benches and the new ones
    come to. `out` is where the new ones go as TOML; `result` keeps the tables of the second."""
    before = shipped()
    cases = [x for f in files for x in cases_of(f, keys)]
    after = fitted(cases)
    by = {
        "as shipped": [(x, before) for x in cases],
        LEFT_OUT: _left_out(cases),
        "by all of them, on themselves": [(x, after) for x in cases],
    }
    visible, seen = ({id(x) for x in part} for part in (showing(cases), noticed(cases, before)))
    for title, judged in by.items():
        print(title)
        print_table(_scores(_said(judged)))
        of_visible, of_seen = ([x for x in judged if id(x[0]) in ids] for ids in (visible, seen))
        print(f"loss: whether {whether(of_visible):.4f}, which {which(of_seen):.4f}")
        print()
    for name in before.__struct_fields__:
        print(f"  {name:<12} {getattr(before, name):>8g} -> {getattr(after, name):g}")
    words = f"{len(cases)} cases of {', '.join(f.stem for f in files)}"
    if result is not None:
        left_out = _said(by[LEFT_OUT])
        tables = {SCORES: _scores(left_out)} | {
            heading: Table(
                ("said", "right [95 %]", "cases"),
                reliability(_of(left_out, of)),
                numeric=frozenset({0, 1, 2}),
            )
            for heading, of in ((PLACES, _place), (NAMES, _name))
        }
        keep(
            result,
            tables,
            title=TITLE,
            command="python -m evaluation calibrate",
            note=f"{words}; {LEFT_OUT}.",
        )
    if out is not None:
        out.write_text(toml(after, words))
        print(f"written: {out}")
    return after


def _left_out(cases: Sequence[CaseRivals]) -> list[Judged]:
    """Each case by the constants of others."""
    out: list[Judged] = []
    for part in folds_of(cases):
        constants = fitted(apart_from(part, cases))
        out += [(x, constants) for x in part]
    return out


def _said(judged: Sequence[Judged]) -> SaidBy:
    return [(x.said(c), c) for x, c in judged]


def toml(c: Constants, words: str) -> str:
    """The file of constants, with what they were fitted to."""
    held = ", ".join(f"{kind} {share:g}" for kind, share in HELD.items())
    allowed = ", ".join(f"{kind} {share:.3g}" for kind, share in ALLOWED.items())
    head = (
        f"# Written by `python -m evaluation calibrate` from {words}.\n"
        "# Under them the right rivals are likeliest, kinds of cases weighed by allowed errors\n"
        f"# ({allowed}); credible_level: reported places hold the truth in {held}.\n"
    )
    return head + "".join(f"{name} = {getattr(c, name)!r}\n" for name in c.__struct_fields__)


def _place(said: Said) -> tuple[float, bool]:
    return said.place


def _name(said: Said) -> tuple[float, bool]:
    return said.name


def _of(
    cases: SaidBy, of: Callable[[Said], tuple[float, bool]], *truths: str
) -> list[tuple[float, bool]]:
    """What was said of noticed effects, and whether it was right."""
    kinds = truths or (LISTED, UNLISTED)
    return [of(s) for s, _ in cases if s.noticed and s.case_rivals.truth in kinds]


def _scores(cases: SaidBy) -> Table:
    """How often the first step is right."""

    def kind(*truths: str) -> list[tuple[Said, Constants]]:
        return [(s, c) for s, c in cases if s.case_rivals.truth in truths]

    effects = kind(LISTED, UNLISTED)
    # Cases of two banks may have one name.
    visible = {id(x) for x in showing([s.case_rivals for s, _ in cases])}
    clear = [(s, c) for s, c in effects if id(s.case_rivals) in visible]
    answered = [(s, c) for s, c in effects if s.noticed]
    listed = [(s, c) for s, c in answered if s.case_rivals.truth == LISTED]
    other = [(s, c) for s, c in answered if s.case_rivals.truth == UNLISTED]
    named = [(s, c) for s, c in answered if s.name[0] >= 0.5]
    rows = [
        share("quiet benches called changed", kind(NONE), lambda x: x[0].kind != NOTHING),
        share("parameters reported as such", kind(MOVED), lambda x: x[0].kind == PARAMETERS),
        share("effects noticed", effects, lambda x: x[0].noticed),
        share(
            "effects noticed, of those that parameters do not imitate",
            clear,
            lambda x: x[0].noticed,
        ),
        *(
            share(f"place right first, {words}", part, lambda x: x[0].place[1])
            for words, part in (("listed", listed), ("unlisted", other))
        ),
        *(
            share(
                f"reported places hold the truth, {words}",
                part,
                lambda x: x[0].reported_places_hold(x[1].credible_level),
            )
            for words, part in (("listed", listed), ("unlisted", other))
        ),
        share("right name first, listed", listed, lambda x: x[0].name[1]),
        share(
            "right name reported, listed", listed, lambda x: x[0].name[1] and x[0].name[0] >= 0.5
        ),
        share("right name, of names reported", named, lambda x: x[0].name[1]),
        share("unlisted reported by name", other, lambda x: x[0].name[0] >= 0.5),
    ]
    lines = [(row.name, number(row), str(row.count)) for row in rows]
    sizes = [len(s.reported_places(c.credible_level)) for s, c in answered]
    if sizes:
        lines.append(
            ("reported places, mean number", f"{statistics.fmean(sizes):.2f}", str(len(sizes)))
        )
    for truth in ALLOWED:
        logs = [
            np.log(s.right + 1e-12)
            for s, _ in kind(truth)
            if s.case_rivals.right.any() and id(s.case_rivals) in visible
        ]
        if logs:
            lines.append((f"mean log probability of the right rival, {truth}",
                          f"{np.mean(logs):.3f}", str(len(logs))))  # fmt: skip
    for words, of in (("places", _place), ("names", _name)):
        of_kinds = [_of(cases, of, kind) for kind in (LISTED, UNLISTED)]
        pairs = [claim for claims in of_kinds for claim in claims]
        if pairs:
            error = f"error of the probabilities of {words}"
            lines.append((error, f"{calibration(pairs):.3f}", str(len(pairs))))
        if all(of_kinds):
            lines.append((f"{error}, as many listed as unlisted",
                          f"{calibration_of_equals(of_kinds):.3f}", str(len(pairs))))  # fmt: skip
    return Table(("score", "value [95 %]", "cases"), lines, numeric=frozenset({1, 2}))
