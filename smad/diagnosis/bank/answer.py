"""A diagnosis in the form of a verdict file."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from itertools import product

from smad.diagnosis.bank.names import OUTCOMES
from smad.diagnosis.bank.verdicts import (
    CaseVerdict,
    Estimate,
    HeldOut,
    Hypothesis,
    NextExperiment,
    Short,
)
from smad.gap.records import NAMED, Budget, Diagnosis, Outcome, ValueRecord, Verdict

_QUIET = {Outcome.NO_GAP: "none", Outcome.PARAMETERS: "parameters"}
_MOST_CAUSES = 12
_LEAST = 1e-4
_BEHIND = 0.8

COMPARABLE: dict[str, Mapping[str, float]] = {
    "driver_gain": {"gain": 1.0},
    "driver_lag": {"tau_s": 1.0},
    "contact_resistance": {"resistance_Ohm": 1.0},
    "rtd_lag": {"tau_s": 1.0},
    "rtd_offset": {"offset_K": 1.0},
    # Mean delay of encoder and load cell; the delay of the temperatures is another question.
    "channel_delay": {"displacement_s": 0.5, "force_s": 0.5},
    "encoder_backlash": {"width_m": 1e3},
    "force_offset": {"offset_N": 1.0},
    "force_gain": {"gain": 1.0},
    # A first-order spin-up delays a ramp by its time constant.
    "pump_lag": {"dead_s": 1.0, "spinup_s": 1.0},
    "flow_shortfall": {"share": 1.0},
    # The quantity is the fall after three full cycles, the parameter the rise with each.
    "transformation_fatigue": {"shift_K": -3.0},
}
"""Effects of the library that have a comparable quantity: weights of its parameters in that sum.

evaluation/bank/quantities.py says what each quantity is. All are changes since the known-good runs.
"""


def answer(diagnosis: Diagnosis) -> CaseVerdict:
    """What the diagnosis says of a case, in names of the library."""
    verdict = diagnosis.verdict
    named = verdict.outcome in NAMED
    causes = hypotheses(verdict, diagnosis.places)
    group = [verdict.effects[0], *verdict.group] if named and verdict.group else []
    experiment = None
    if diagnosis.experiments:
        between = group or _confused(verdict) or [n for h in causes[:2] for n in h.names]
        experiment = NextExperiment(diagnosis.experiments[0].name, between)
    return CaseVerdict(
        outcome=OUTCOMES[verdict.outcome],
        causes=causes,
        group=group if verdict.outcome is Outcome.AMBIGUOUS else [],
        subsystem=verdict.sub_model,
        regime=", ".join(verdict.regimes),
        held_out=held_out(diagnosis),
        budget=budget_shares(diagnosis.budget),
        shrink=None if verdict.outcome is Outcome.REFUSED else verdict.shrink,
        quantities=quantities(diagnosis.values) if named else {},
        next_experiment=experiment,
        left_out={r.effect: Short(OUTCOMES[r.outcome], r.names) for r in diagnosis.left_out},
        seconds=round(diagnosis.seconds, 2),
    )


def _confused(verdict: Verdict) -> list[str]:
    """A cause and the parameters that stand for it, if that is what an experiment is to part."""
    causes = verdict.effects if verdict.imitated else verdict.instead
    return [*causes, _QUIET[Outcome.PARAMETERS]] if causes else []


def held_out(diagnosis: Diagnosis) -> dict[str, HeldOut]:
    """RMS residual of each channel on the held-out runs, in its unit, from the local views.

    A gap is the excess over the floor; with the floor it makes the RMS again. Where two views
    predict one channel, the first counts.
    """
    out: dict[str, HeldOut] = {}
    for row in diagnosis.waterfall:
        if row.view != "local" or not row.channel or row.channel in out:
            continue
        after = row.effects[-1] if row.effects else row.refit
        raw, refit, effect = (row.floor * (1.0 + g * g) ** 0.5 for g in (row.raw, row.refit, after))
        out[row.channel] = HeldOut(raw, refit, effect, row.floor)
    return out


def budget_shares(budget: Budget | None) -> dict[str, float]:
    """Shares of the raw gap of all signals together, in the order in which they are taken."""
    if budget is None:
        return {}
    row = budget.rows[0]
    causes = dict(zip(budget.causes, row.causes, strict=True))
    return {"parameters": row.parameters, **causes, "rest": row.rest}


def hypotheses(verdict: Verdict, places: Mapping[str, Mapping[str, float]]) -> list[Hypothesis]:
    """Ranked sets of effects with their probabilities, summing to at most 1.

    The effects' places are taken as independent: a set has the product of its members' shares. What
    the diagnosis gives to *unknown* is taken off all of them in proportion.
    """
    outcome = verdict.outcome
    if outcome in (Outcome.NO_EXCITATION, Outcome.REFUSED, Outcome.CONTRADICTING):
        return []
    sets = _sets(places)
    if outcome in _QUIET:
        # The probability of the verdict is that of nothing being there. No set was accepted, so
        # that none stands before it; what they leave belongs to nothing that has a name here.
        quiet = frozenset((_QUIET[outcome],))
        p = verdict.probability
        weight = {quiet: p} | _scaled(sets, 1.0 - p, most=_BEHIND * p)
    else:
        unknown = _unknown(verdict, places)
        none = sets.pop(frozenset(), 0.0)
        weight = {s: p * (1.0 - unknown) for s, p in sets.items()}
        weight[frozenset(("parameters",))] = none * (1.0 - unknown)
        # A calibration may take more off the verdict than its evidence does. What it takes belongs
        # to nothing that has a name: what the verdict says stands first.
        if outcome is Outcome.UNKNOWN:
            weight = _scaled(weight, sum(weight.values()), most=_BEHIND * unknown)
        else:
            unknown = min(unknown, _BEHIND * max(weight.values(), default=0.0))
        weight[frozenset(("unknown",))] = unknown
    own = frozenset(verdict.effects)
    ranked = sorted(weight.items(), key=lambda pair: (-pair[1], pair[0] != own, sorted(pair[0])))
    kept = [(s, p) for s, p in ranked if p >= _LEAST][:_MOST_CAUSES]
    total = max(1.0, sum(p for _, p in kept))
    return [Hypothesis(_ordered(s, verdict), p / total) for s, p in kept]


def _ordered(names: frozenset[str], verdict: Verdict) -> list[str]:
    """The verdict's own order of importance first."""
    known = {n: i for i, n in enumerate(verdict.effects)}
    return sorted(names, key=lambda n: (known.get(n, len(known)), n))


def _sets(places: Mapping[str, Mapping[str, float]]) -> dict[frozenset[str], float]:
    out: dict[frozenset[str], float] = {}
    tables = [list(table.items()) for table in places.values()]
    for choice in product(*tables) if tables else ():
        names = frozenset(n for n, _ in choice if n)
        out[names] = out.get(names, 0.0) + math.prod(p for _, p in choice)
    return out


def _scaled(
    sets: Mapping[frozenset[str], float], total: float, most: float
) -> dict[frozenset[str], float]:
    """The sets with a sum of `total`, or less where the largest would exceed `most`."""
    some = {s: p for s, p in sets.items() if s}
    have, largest = sum(some.values()), max(some.values(), default=0.0)
    if have <= 0.0:
        return {}
    factor = min(total / have, most / largest)
    return {s: p * factor for s, p in some.items()}


def _unknown(verdict: Verdict, places: Mapping[str, Mapping[str, float]]) -> float:
    """Probability that the cause is not in the library.

    A verdict that names causes carries P(named) · (1 − P(unknown)).
    """
    if verdict.outcome is Outcome.UNKNOWN:
        return verdict.probability
    shares = {n: p for table in places.values() for n, p in table.items()}
    named = min(1.0, sum(shares.get(n, 0.0) for n in [*verdict.effects[:1], *verdict.group]))
    return min(1.0, max(0.0, 1.0 - verdict.probability / named)) if named > 0 else 1.0


def quantities(values: Sequence[ValueRecord]) -> dict[str, Estimate]:
    """Comparable quantities of the effects of a diagnosis, by effect.

    Intervals of a sum are added in quadrature, as if its parts were independent.
    """
    out = {}
    for effect in dict.fromkeys(v.effect for v in values):
        weights = COMPARABLE.get(effect, {})
        own = [(weights[v.name], v) for v in values if v.effect == effect and v.name in weights]
        if own:
            out[effect] = _sum(own)
    return out


def _sum(parts: Sequence[tuple[float, ValueRecord]]) -> Estimate:
    value = sum(w * (v.value - v.before) for w, v in parts)
    # A negative weight turns an interval over.
    below = [w * (v.value - v.low) if w > 0 else w * (v.value - v.high) for w, v in parts]
    above = [w * (v.high - v.value) if w > 0 else w * (v.low - v.value) for w, v in parts]
    return Estimate(value, value - math.hypot(*below), value + math.hypot(*above))
