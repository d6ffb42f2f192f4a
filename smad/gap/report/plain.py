"""The answer in a sentence or two, for somebody who has not read how it was found."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from smad.gap.records import Budget, BudgetRow, Diagnosis, Outcome, ValueRecord

_TOLD = 0.005
"""A share smaller than this is not told as a number."""
_QUIET = {
    Outcome.NO_EXCITATION: "These runs move the bench too little to answer.",
    Outcome.NO_GAP: "Model and bench agree within the noise.",
}
_NOT_NEW = (
    "Whether it is new cannot be told: these runs drive the bench where no known-good run was."
)
_QUIET_SINCE = "Nothing that stands out has changed since the known-good runs."


def plain(
    outcome: Outcome,
    *,
    titles: Mapping[str, str],
    effects: Sequence[str],
    group: Sequence[str],
    values: Sequence[ValueRecord],
    budget: Budget,
    bounded: Sequence[str] = (),
    since_good: bool = False,
    further: bool = False,
) -> str:
    """What the diagnosis says, and how much of the gap goes with it.

    `titles` are those of the library's effects, `effects` those named, `group` what the first of
    them cannot be told from, `bounded` those that ran into the bound of their range, `further`
    whether the runs go where no known-good run was.
    """
    if outcome is Outcome.NO_GAP and since_good:
        return _QUIET_SINCE
    if outcome in _QUIET:
        return _QUIET[outcome]
    said = [_said(outcome, titles, effects, group, values, bounded=bounded)]
    said += [_NOT_NEW] if since_good and further else []
    return " ".join([*said, *_goes(outcome, titles, budget)])


def _said(
    outcome: Outcome,
    titles: Mapping[str, str],
    effects: Sequence[str],
    group: Sequence[str],
    values: Sequence[ValueRecord],
    *,
    bounded: Sequence[str],
) -> str:
    if outcome is Outcome.PARAMETERS:
        return "Other values of the parameters explain it; no further cause is needed."
    if bounded:
        what = " and ".join(titles[n] for n in bounded)
        return (
            f"No cause found: the nearest entry of the library ({what}) would have to be stronger "
            "than its range allows."
        )
    if outcome is Outcome.UNKNOWN:
        return "The gap is real, and nothing in the library explains it."
    said = "; and ".join(f"{titles[n]}{_strength(n, values)}" for n in effects)
    said = said[:1].upper() + said[1:]
    if outcome is Outcome.AMBIGUOUS and group:
        return f"{said}; or {' or '.join(titles[n] for n in group)}: these runs do not tell which."
    return f"{said}."


def _strength(effect: str, values: Sequence[ValueRecord]) -> str:
    told = []
    for v in values:
        if v.effect == effect:
            unit = "" if v.unit == "1" else f" {v.unit}"
            told.append(f"{v.name} = {_two_digits(v.value)}{unit}")
    return f" ({', '.join(told)})" if told else ""


def _two_digits(value: float) -> str:
    return f"{value:#.2g}".rstrip(".") if value else "0"


def _goes(outcome: Outcome, titles: Mapping[str, str], budget: Budget) -> list[str]:
    """Sentences on how much of the gap goes with what."""
    total = budget.rows[0]
    taken = [(f"{n}", share) for n, share in zip(budget.causes, total.causes, strict=True)]
    if outcome is Outcome.PARAMETERS:
        return [f"They take {_percent(total.parameters)} of the gap; {_rest(total.rest)}"]
    if not budget.named:
        return [f"{_without_a_name(total, titles, taken)}; {_rest(total.rest)}"]
    if len(taken) == 1:
        parts = [f"{_percent(taken[0][1])} of the gap goes with that"]
    else:
        parts = [f"{_percent(share)} of the gap goes with {n}" for n, share in taken]
    if budget.parameters and total.parameters > -_TOLD:
        parts.append(f"{_percent(total.parameters)} with other values of the parameters")
    elif budget.parameters:
        parts.append(f"of which other values of the parameters add {_percent(-total.parameters)}")
    said = ", ".join(parts)
    return [f"{said[:1].upper() + said[1:]}; {_rest(total.rest)}"]


def _without_a_name(
    total: BudgetRow, titles: Mapping[str, str], taken: Sequence[tuple[str, float]]
) -> str:
    best = [
        (_percent(share), f"with the best entry of the library ({titles[n]})")
        for n, share in taken
        if share > _TOLD
    ]
    if total.parameters > -_TOLD:
        first = f"{_percent(total.parameters)} of the gap goes with other values of the parameters"
        return ", ".join([first, *(f"{part} {what}" for part, what in best)])
    more = _percent(-total.parameters)
    first = f"Other values of the parameters, fitted to some runs, add {more} to the gap of others"
    return "; ".join([first, *(f"{part} of it goes {what}" for part, what in best)])


def _rest(share: float) -> str:
    return f"{_percent(share)} is left."


def _percent(share: float) -> str:
    """A share as whole per cent; what rounds to nothing or to all is said so only if it is."""
    if 0.0 < share < _TOLD:
        return "less than 1 %"
    if 1.0 - _TOLD <= share < 1.0:
        return "more than 99 %"
    return f"{round(100 * share)} %"


def repeated_lines(d: Diagnosis) -> list[str]:
    """What the runs say that repeat known-good ones; nothing where none does."""
    if d.repeated is None:
        return []
    if d.repeated.headline:
        said = f"Runs that repeat good ones, compared with these directly: {d.repeated.headline}."
    else:
        said = (
            "Runs repeat a known-good one. Record that once more with the same inputs, and they "
            "are compared directly, without the model's form error."
        )
    return [said, *d.repeated.pairs]
