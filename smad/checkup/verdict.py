"""The verdict of a check-up: one rule over the findings, a budget, and words for both."""

from __future__ import annotations

from collections.abc import Sequence

import msgspec
import numpy as np

from smad.checkup.constants import Constants
from smad.checkup.evidence import Evidence, evidence
from smad.checkup.judge import Findings
from smad.checkup.paired.difference import SHARE, Paired
from smad.diagnosis.gap import change_of, with_effects
from smad.diagnosis.plant import Array, EffectValues, Mask
from smad.diagnosis.report.words import place_lines
from smad.diagnosis.search.locate import Located
from smad.diagnosis.search.names import score
from smad.diagnosis.search.refine import Refined
from smad.diagnosis.verdict import PlaceTold, change_headline

QUIET, PARAMETERS, CAUSE, GROUP, UNKNOWN = "quiet", "parameters", "cause", "group", "unknown"


class Share(msgspec.Struct, frozen=True):
    """One signal's budget, RMS in its unit: raw difference; less days and small moves of
    parameters; less the named entries as well, or less the laws of the places in the simulator,
    each run with laws that it had no part in; and what a bench without a change shows."""

    signal: str
    unit: str
    raw: float
    parameters: float
    entries: float
    noise: float
    laws: float = 0.0


class Likely(msgspec.Struct, frozen=True):
    """A hypothesis: entries at work together, or "parameters" or "unknown"."""

    names: list[str]
    probability: float
    values: dict[str, dict[str, float]] = {}


class Verdict(msgspec.Struct, frozen=True):
    """What a check-up says.

    `outcome` is quiet, parameters, cause, group or unknown. `places` say where the change lies,
    the one that takes most first; an entry is a cause only where it acts at such a place. `left` is
    what the named entries leave of what a flexible correction takes; `ratio` the mean square over
    the floor's; `budget` by signal, `whole` over all signals in floors. `notes` say what a reader
    must know of the runs.
    """

    outcome: str
    headline: str
    likely: list[Likely]
    group: list[str]
    left: float
    ratio: float
    worst_run: str
    budget: list[Share]
    whole: Share
    notes: list[str]
    repeats: int
    places: list[PlaceTold] = []


def decide(
    paired: Paired, findings: Findings, constants: Constants, located: Located | None = None
) -> Verdict:
    """The verdict, by the rule that `Constants` explains.

    `located` says where the change lies, beside small moves of the parameters; None for a plant
    whose equations cannot be forced, of which the library alone is asked. Other values of the
    parameters are an answer where no place takes much of what they leave.
    """
    f = findings
    outcome, likely, group = _outcome(f, constants)
    places: list[PlaceTold] = []
    if located is not None and outcome != QUIET:
        places = list(located.told)
        if outcome == PARAMETERS and not located.beside_parameters:
            places = []
        else:
            outcome, likely, group = _at_places(places, likely)
    names = likely[0].names if outcome in (CAUSE, GROUP) else []
    values = likely[0].values if names else {}
    left = _left(f, names, constants) if outcome != QUIET else 0.0
    tried = located.change if located is not None and any(p.in_simulator for p in places) else None
    budget, whole = budget_of(paired, values, tried)
    worst = int(np.argmax(f.by_run)) if len(f.by_run) else 0
    return Verdict(
        outcome=outcome,
        headline=(
            change_headline(places)
            if places
            else _headline(outcome, likely, group, left, constants)
        ),
        likely=likely,
        group=group,
        left=left,
        ratio=f.ratio,
        worst_run=paired.pairs[worst].now,
        budget=budget,
        whole=whole,
        notes=_notes(paired, f.fits[_index_of(f, names)] if _refined(f, names) else None),
        repeats=paired.reference.repeats,
        places=places,
    )


def _at_places(
    places: Sequence[PlaceTold], likely: Sequence[Likely]
) -> tuple[str, list[Likely], list[str]]:
    """Names that agree with the places: those that act there, in the places' order."""
    if not places or not places[0].name:
        return UNKNOWN, [Likely([UNKNOWN], 1.0)], []
    named = [p for p in places if p.name]
    values = {p.name: own for p in reversed(named) for own in [p.values[p.name]]}
    names = list(dict.fromkeys(p.name for p in named))
    probability = next((x.probability for x in likely if x.names == names), 0.0)
    return CAUSE, [Likely(names, probability, values)], []


def _refined(f: Findings, names: Sequence[str]) -> bool:
    return bool(names) and list(names) in [list(fit.names) for fit in f.fits]


def is_quiet(f: Findings, constants: Constants) -> bool:
    """Whether nothing stands out of the repeat floor."""
    best = score(f.singles[0]) if f.singles else 0.0
    return bool(
        best < constants.quiet_gain
        and f.ratio < constants.quiet_ratio
        and f.by_channel.max() < constants.channel_ratio
    )


def _outcome(f: Findings, constants: Constants) -> tuple[str, list[Likely], list[str]]:
    if is_quiet(f, constants):
        return QUIET, [], []
    likely = hypotheses(f, constants)
    top, *others = first_names(likely)
    if top.names == [UNKNOWN]:
        return UNKNOWN, likely, []
    if top.names == [PARAMETERS]:
        return PARAMETERS, likely, []
    near = [
        x.names[0]
        for x in others
        if x.names != [UNKNOWN] and x.probability * constants.odds > top.probability
    ]
    return (GROUP, likely, [top.names[0], *near]) if near else (CAUSE, likely, [])


def first_names(likely: Sequence[Likely]) -> list[Likely]:
    """The likeliest hypothesis for each first name, with the probability of all that begin so."""
    total: dict[str, float] = {}
    for x in likely:
        total[x.names[0]] = total.get(x.names[0], 0.0) + x.probability
    best = {x.names[0]: x for x in reversed(likely)}
    found = [msgspec.structs.replace(best[name], probability=p) for name, p in total.items()]
    return sorted(found, key=lambda x: -x.probability)


def _index_of(f: Findings, names: Sequence[str]) -> int:
    return [list(fit.names) for fit in f.fits].index(list(names))


def _left(f: Findings, names: Sequence[str], constants: Constants) -> float:
    """Share that the named entries leave of what a flexible correction takes; else the best's."""
    if not f.singles:
        return 1.0
    found = evidence(f.products, constants)
    return found.left_by(_index_of(f, names) if _refined(f, names) else _best(found))


def _best(found: Evidence) -> int:
    """The hypothesis with the most evidence; −1 for parameters."""
    best = int(np.argmax(found.sets))
    return best if found.sets[best] > found.parameters else -1


def hypotheses(f: Findings, constants: Constants) -> list[Likely]:
    """What may be the matter with a bench that has changed, with probabilities.

    Unknown is the likelier the more the best of the others leaves of what a flexible correction
    takes; the rest is shared by evidence. First come those that begin with the likeliest first
    name, and the likeliest of them before the others.
    """
    if not f.singles:
        return [Likely([UNKNOWN], 1.0)]
    told = [Likely(list(fit.names), 0.0, fit.values) for fit in f.fits]
    told += [Likely([PARAMETERS], 0.0), Likely([UNKNOWN], 0.0)]
    shares = weighed(evidence(f.products, constants), sizes_of(f), constants)
    likely = [
        msgspec.structs.replace(x, probability=float(p)) for x, p in zip(told, shares, strict=True)
    ]
    likely.sort(key=lambda x: -x.probability)
    order = [x.names[0] for x in first_names(likely)]
    return sorted(likely, key=lambda x: order.index(x.names[0]))


def sizes_of(f: Findings) -> Array:
    """How many entries each fit has."""
    return np.array([len(fit.names) for fit in f.fits])


def weighed(found: Evidence, sizes: Array, constants: Constants) -> Array:
    """Probability of each fit, whose `sizes` these are, of parameters, and of unknown."""
    further = np.log(constants.further_odds) * (sizes - 1)
    logs = np.append(found.sets + further, found.parameters + np.log(constants.parameter_odds))
    shares = np.exp(logs - logs.max())
    left = _odds(found.left_by(_best(found)))
    unknown = left / (left + _odds(constants.unknown_left))
    return np.append((1.0 - unknown) * shares / shares.sum(), unknown)


def _odds(share: float) -> float:
    return share / max(1.0 - share, 1e-9)


def _headline(
    outcome: str, likely: list[Likely], group: list[str], left: float, constants: Constants
) -> str:
    if outcome == QUIET:
        return "no change beyond the repeat floor"
    if outcome == PARAMETERS:
        return (
            "changed: other values of the parameters explain it, no entry of the library is needed"
        )
    if outcome == UNKNOWN:
        return (
            f"changed, cause unknown: the best of the library leaves {100 * left:.0f} % of it "
            f"(a name may leave {100 * constants.unknown_left:.0f} %)"
        )
    if outcome == GROUP:
        return f"changed: {' or '.join(group)}, which these runs do not tell apart"
    names = " + ".join(likely[0].names)
    rest = f"; {100 * left:.0f} % of the change is not explained" if left > 0.1 else ""
    return f"changed: {names} (probability {likely[0].probability:.2f}){rest}"


def budget_of(
    paired: Paired, values: EffectValues, tried: Sequence[Array] | None = None
) -> tuple[list[Share], Share]:
    """Raw difference, less the days and parameters of the joint fit, less the entries as well, or
    less what the laws of the places made of each run (`tried`).

    By signal, and over all signals in floors.
    """
    raw = [p.difference for p in paired.pairs]
    change = change_of(paired, with_effects(paired.point, values)) if values else None
    entries = change or [np.zeros_like(d) for d in raw]
    after = _without_days(paired, [d - c for d, c in zip(raw, entries, strict=True)])
    beside = [x + c for x, c in zip(after, entries, strict=True)]
    laws = after
    if tried is not None:
        laws = _without_days(paired, [d - c for d, c in zip(raw, tried, strict=True)])
    sd = [p.rows.sd for p in paired.pairs]
    valid = [p.rows.valid for p in paired.pairs]
    stages = (raw, beside, after, sd, laws)
    columns = [_rms(x, valid) for x in stages]
    shares = [
        Share(c.name, c.unit, *(float(column[i]) for column in columns))
        for i, c in enumerate(paired.plant.channels)
        if any(v[:, i].any() for v in valid)
    ]
    floors = [[x / s for x, s in zip(part, sd, strict=True)] for part in stages]
    return shares, Share("all signals", "floors", *(_overall(x, valid) for x in floors))


def _overall(parts: list[Array], valid: list[Mask]) -> float:
    rows = np.concatenate([x[v] for x, v in zip(parts, valid, strict=True)])
    return float(np.sqrt(np.mean(rows**2)))


def _rms(parts: list[Array], valid: list[Mask]) -> Array:
    rows, good = np.concatenate(parts), np.concatenate(valid)
    count = np.maximum(good.sum(axis=0), 1)
    return np.asarray(np.sqrt(np.where(good, rows**2, 0.0).sum(axis=0) / count))


def _without_days(paired: Paired, difference: list[Array]) -> list[Array]:
    """The difference less the most likely day of each run and the parameters' small move."""
    r = paired.tie(paired.white([d[None] for d in difference]))[0]
    J = SHARE * paired.tie(paired.slopes)
    # The posterior mean of directions that were shrunk is their product with the white rows.
    theta = J @ r * SHARE
    out = []
    for p, d in zip(paired.pairs, difference, strict=True):
        moved = d - np.tensordot(theta, p.reference.slopes, axes=1)
        own = p.rows.shrink(p.rows.independent(moved[None]))[0]
        days = p.rows.shrink(p.rows.days) @ own
        out.append(moved - np.tensordot(days * p.rows.day_sd, p.rows.day, axes=1))
    return out


def _notes(paired: Paired, fit: Refined | None) -> list[str]:
    out = []
    if paired.reference.repeats < 2:
        out.append(
            "a run was recorded good only once: the repeat floor is a guess; record it again "
            "on another day"
        )
    for p in paired.pairs:
        if p.share < 0.98:
            out.append(
                f"{p.now} counts as far as it goes: {100 * p.share:.0f} % of it was recorded"
            )
        if p.carried:
            out.append(f"{p.now}: inputs differed from the good run's; the model carried that over")
    if lost := _lost(paired):
        out.append(f"recorded then and not now, and left out: {lost}")
    warm = [
        f"{c} {p.around[c] - p.reference.around[c]:+.1f} K in {p.now}"
        for p in paired.pairs
        for c in p.around
        if c in p.reference.around and abs(p.around[c] - p.reference.around[c]) > 1.0
    ]
    if warm:
        out.append("carried over by the model: " + ", ".join(warm))
    if fit is not None and fit.at_bound:
        out.append(f"at the end of its range: {', '.join(fit.at_bound)}")
    return out


def _lost(paired: Paired) -> str:
    """Channels of which now most readings are missing that the good runs have, with the runs."""
    runs: dict[str, list[str]] = {}
    for p in paired.pairs:
        had, has = p.reference.valid.sum(axis=0), p.rows.valid.sum(axis=0)
        for c, then, now in zip(paired.plant.channels, p.share * had, has, strict=True):
            if now < 0.5 * then:
                runs.setdefault(c.name, []).append(p.now)
    return ", ".join(f"{channel} ({', '.join(own)})" for channel, own in runs.items())


UNCALIBRATED = (
    "the probabilities are relative to the library and not calibrated yet: on development benches"
    " they were too sure (smad docs guide/check-up)"
)


def budget_lines(shares: Sequence[Share], *, laws: bool = False) -> list[str]:
    """A budget as a table; `laws`: what the laws of the places leave, in place of the entries."""
    last = "less law" if laws else "less named"
    head = f"{'RMS of now − then':<27} {'raw':>9} {'less days':>9} {last:>10} {'floor':>9}"
    return [head] + [
        f"{s.signal:<19} {s.unit:<7} {s.raw:>9.3g} {s.parameters:>9.3g} "
        f"{s.laws if laws else s.entries:>10.3g} {s.noise:>9.3g}"
        for s in shares
    ]


def lines(verdict: Verdict) -> list[str]:
    """The verdict in plain words, the headline first."""
    v = verdict
    out = [v.headline]
    for place in v.places:
        out += place_lines(place)
    for x in v.likely[:3] if not v.places else ():
        if x.probability < 0.02:
            continue
        values = "; ".join(
            f"{q} = {number:.3g}" for own in x.values.values() for q, number in own.items()
        )
        out.append(
            f"  {x.probability:.2f}  {' + '.join(x.names)}{f'  ({values})' if values else ''}"
        )
    out += budget_lines((*v.budget, v.whole), laws=bool(v.places))
    if v.outcome != QUIET:
        out.append(f"the run with most of it: {v.worst_run}")
    if v.outcome not in (QUIET, UNKNOWN) and not v.places:
        out.append(UNCALIBRATED)
    return [*out, *v.notes]
