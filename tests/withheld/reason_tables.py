"""What stands in the way, to read: a line for each case, and how many cases each reason has."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from smad.gap.settings import Settings
from smad.report.page import Table
from tests.withheld.reasons import Explained, Told, counts, parted


def count_table(cases: Sequence[Explained], settings: Settings) -> Table:
    """How many cases each reason has, by strength and in all, and how many of all the best few
    experiments should separate."""
    counted = counts(cases)
    strengths = list(next(iter(counted.values()), {}))
    rows, total = [], [0] * (len(strengths) + 2)
    for reason, by_strength in counted.items():
        more = sum(parted(x, settings) for x in cases if x.reason == reason)
        found = [*by_strength.values(), sum(by_strength.values()), more]
        total = [a + b for a, b in zip(total, found, strict=True)]
        rows.append([reason, *(str(n) if n else "·" for n in found)])
    rows.append(["all", *map(str, total)])
    heads = ["reason", *strengths, "all", "parted by more runs"]
    return Table(heads, rows, numeric=frozenset(range(1, len(heads))))


def _number(value: float | None) -> str:
    """Three digits at most, so that a line stays a line."""
    if value is None:
        return "–"
    return f"{value:.2f}" if abs(value) < 10 else f"{value:.0f}" if abs(value) < 1e5 else ">1e5"


def _of_fit(t: Told, name: str) -> str:
    fit = None if t.entry is None else t.entry.fit
    return _number(None if fit is None else getattr(fit, name))


def _nearest(t: Told, name: str) -> str:
    rivals = [] if t.entry is None else t.entry.rivals
    return _number(getattr(rivals[0], name) if rivals else None)


def _errors(gain: float, error: float) -> str:
    """A gain in its standard errors."""
    return _number(gain / error) if error > 0.0 else "–"


def _gain(t: Told) -> str:
    fit = None if t.entry is None else t.entry.fit
    return "–" if fit is None else f"{_errors(fit.gain, fit.gain_se)} of {fit.asked:.0f}"


def _next(t: Told) -> str:
    if not t.apart:
        return "–"
    best = t.apart[0]
    return f"{best.experiment} {_number(best.counted)} of {_number(best.d2)}"


def _free(t: Told) -> str:
    return "–" if t.entry is None else _errors(
        t.entry.standing.free_gain, t.entry.standing.free_gain_se
    )  # fmt: skip


def _said(t: Told) -> str:
    return " + ".join(t.said) or t.outcome


_COLUMNS: tuple[tuple[str, Callable[[Explained], str]], ...] = (
    ("case", lambda x: x.told.case),
    ("cause", lambda x: x.told.cause),
    ("said", lambda x: _said(x.told)),
    ("reason", lambda x: x.reason),
    ("floors", lambda x: _number(x.told.true_floors)),
    ("backgr.", lambda x: _number(x.told.true_background)),
    ("fitted", lambda x: _of_fit(x.told, "size_background")),
    ("masked", lambda x: _number(None if x.told.entry is None else x.told.entry.hidden)),
    ("gain/se", lambda x: _gain(x.told)),
    ("before", lambda x: _of_fit(x.told, "excess_before")),
    ("d² none", lambda x: _of_fit(x.told, "d2_nothing")),
    ("d² free", lambda x: _of_fit(x.told, "d2_free")),
    ("d² given", lambda x: _nearest(x.told, "d2")),
    ("odds", lambda x: _nearest(x.told, "odds")),
    ("free/se", lambda x: _free(x.told)),
    ("a run more, d²", lambda x: _next(x.told)),
)


def case_table(cases: Sequence[Explained]) -> Table:
    """One line a case; docs/withheld.md says what the columns are."""
    rows = [[cell(x) for _, cell in _COLUMNS] for x in cases]
    return Table(
        [head for head, _ in _COLUMNS], rows, numeric=frozenset(range(4, len(_COLUMNS) - 1))
    )
