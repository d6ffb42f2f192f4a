"""The answer in a sentence or two, for somebody who has not read how it was found."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from smad.gap.records import Budget, Diagnosis, Outcome, RunAgreement, ValueRecord
from smad.gap.report.terms import with_unit

_TOLD = 0.005
"""A share smaller than this is not told as a number."""
_TOO_LITTLE = "These runs move the bench too little to answer."
_QUIET = "Model and bench agree within the noise."
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
    agreement: Sequence[RunAgreement] = (),
) -> str:
    """What the diagnosis says, and how much of the gap goes with it.

    `titles` are those of the library's effects, `effects` those named, `group` what the first of
    them cannot be told from, `bounded` those that ran into the bound of their range, `further`
    whether the runs go where no known-good run was, `agreement` what each run says by itself.
    """
    if outcome is Outcome.CONTRADICTING:
        return contradicting(agreement)
    if outcome is Outcome.NO_EXCITATION:
        return _TOO_LITTLE
    if outcome is Outcome.NO_GAP:
        return _QUIET_SINCE if since_good else _QUIET
    if outcome is Outcome.PARAMETERS:
        said = "Other values of the parameters explain it; no further cause is needed."
    elif bounded:
        what = " and ".join(titles[n] for n in bounded)
        said = (
            f"No cause found: the nearest entry of the library ({what}) would have to be stronger "
            "than its range allows."
        )
    elif outcome is Outcome.UNKNOWN:
        said = "The gap is real, and nothing in the library explains it."
    else:
        said = _capital("; and ".join(f"{titles[n]}{_strength(n, values)}" for n in effects))
        if outcome is Outcome.AMBIGUOUS and group:
            said += f"; or {' or '.join(titles[n] for n in group)}: these runs do not tell which"
        said += "."
    not_new = [_NOT_NEW] if since_good and further else []
    return " ".join([said, *not_new, _goes(outcome, titles, budget)])


def contradicting(agreement: Sequence[RunAgreement]) -> str:
    """Which runs contradict the others, or that none agrees with another."""
    apart = [r.run for r in agreement if r.contradicts]
    if len(apart) == len(agreement):
        said = f"{' and '.join(apart)} contradict each other"
    else:
        verb = "contradicts" if len(apart) == 1 else "contradict"
        said = f"{', '.join(apart)} {verb} the other runs"
    return (
        f"{said}: one set of values cannot serve all of them. The bench was changed between them, "
        "or they are of two benches. No cause is named from such runs together."
    )


def _capital(said: str) -> str:
    return said[:1].upper() + said[1:]


def _strength(effect: str, values: Sequence[ValueRecord]) -> str:
    own = [v for v in values if v.effect == effect]
    told = ", ".join(f"{v.name} = {with_unit(_two_digits(v.value), v.unit)}" for v in own)
    return f" ({told})" if told else ""


def _two_digits(value: float) -> str:
    return f"{value:#.2g}".rstrip(".") if value else "0"


def _goes(outcome: Outcome, titles: Mapping[str, str], budget: Budget) -> str:
    """A sentence on how much of the gap goes with what."""
    total = budget.rows[0]
    taken = dict(zip(budget.causes, total.causes, strict=True))
    if outcome is Outcome.PARAMETERS:
        said = f"They take {_percent(total.parameters)} of the gap"
    elif budget.named:
        said = _with_names(budget, taken)
    else:
        said = _without_a_name(total.parameters, titles, taken)
    return f"{said}; {_percent(total.rest)} is left."


def _with_names(budget: Budget, taken: Mapping[str, float]) -> str:
    parameters = budget.rows[0].parameters
    parts = [
        f"{_percent(share)} of the gap goes with {'that' if len(taken) == 1 else name}"
        for name, share in taken.items()
    ]
    if budget.parameters and parameters > -_TOLD:
        parts.append(f"{_percent(parameters)} with other values of the parameters")
    elif budget.parameters:
        parts.append(f"of which other values of the parameters add {_percent(-parameters)}")
    return _capital(", ".join(parts))


def _without_a_name(
    parameters: float, titles: Mapping[str, str], taken: Mapping[str, float]
) -> str:
    if parameters > -_TOLD:
        first = f"{_percent(parameters)} of the gap goes with other values of the parameters"
        joint, goes = ", ", ""
    else:
        added = f"add {_percent(-parameters)} to the gap of others"
        first = f"Other values of the parameters, fitted to some runs, {added}"
        joint, goes = "; ", " of it goes"
    best = [
        f"{_percent(share)}{goes} with the best entry of the library ({titles[n]})"
        for n, share in taken.items()
        if share > _TOLD
    ]
    return joint.join([first, *best])


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
