"""The constants of a check-up's decision from benches whose truth is known.

Limits of a quiet bench are quantiles of what quiet benches show, moved outward until benches left
out keep them. What turns scores into
probabilities is chosen by the mean log probability of the truth. How good that is, is told by
leaving out one bench after the other.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise, product

import msgspec
import numpy as np

from smad.checkup.constants import Constants
from smad.checkup.evidence import evidence
from smad.checkup.judge import Findings
from smad.checkup.verdict import Likely, hypotheses, is_quiet, sizes_of, weighed
from smad.diagnosis.bank.names import canonical
from smad.diagnosis.plant import Array
from smad.diagnosis.search.names import score
from smad.diagnosis.search.refine import Refined

FALSE_ALARMS = 1.0 / 60.0
"""Of quiet benches, one in so many may be called changed, over all three limits together."""
_LIMITS = 3
_LEAST_SHARE = 1e-9
SHARES = (0.1, 0.15, 0.2, 0.3, 0.4, 0.5)
FREE = (0.1, 0.15, 0.25, 0.4)
ODDS = tuple(
    product(
        (1.0, 10.0, 30.0, 100.0, 300.0, 1000.0),
        (0.3, 0.1, 0.03, 0.01),
        (0.3, 0.4, 0.5, 0.6, 0.7, 0.8),
    )
)
"""Candidates of `parameter_odds`, `further_odds` and `unknown_left`."""
LEAST_PROBABILITY = 1e-2
_BINS = (0.0, 0.2, 0.4, 0.6, 0.8, 0.95, 1.0)


@dataclass(frozen=True)
class Truth:
    """What was the matter: `quiet`, `parameters`, `unknown`, or the causes at work as `names`.

    Names are canonical: several entries of a library may be the same answer.
    """

    kind: str
    names: frozenset[str] = frozenset()

    def probability(self, likely: Sequence[Likely]) -> float:
        """What a check-up gave to the truth; a set counts when it is named whole."""
        right = self.names or {self.kind}
        return sum(x.probability for x in likely if set(map(canonical, x.names)) == right)


@dataclass(frozen=True)
class Judged:
    """What a check-up found, beside the truth."""

    bench: str
    truth: Truth
    findings: Findings


@dataclass(frozen=True)
class Reliability:
    """How well probabilities fit: `rows` are (from, to, count, mean probability, share right).

    `log_score` is the mean logarithm of the probability of the truth, `error` the difference of
    probability and share, weighted by counts; `count` check-ups were called changed.
    """

    count: int
    log_score: float
    on_truth: float
    error: float
    rows: tuple[tuple[float, float, int, float, float], ...]


def quiet_limits(judged: Sequence[Judged], constants: Constants) -> Constants:
    """The limits of a quiet bench: quantiles of what quiet benches show.

    Benches differ more than days of one do. So the quantile is moved outward until benches by
    limits from the others are called changed as seldom as they should be.
    """
    found = [j for j in judged if j.truth.kind == "quiet"]
    benches = sorted({j.bench for j in found})
    share = FALSE_ALARMS / _LIMITS
    while share > _LEAST_SHARE:
        alarms = 0
        for bench in benches:
            others = [j.findings for j in found if j.bench != bench]
            limits = _limits(others, share, constants)
            alarms += sum(not is_quiet(j.findings, limits) for j in found if j.bench == bench)
        if alarms <= FALSE_ALARMS * len(found):
            break
        share /= 2.0
    return _limits([j.findings for j in found], share, constants)


def _limits(found: Sequence[Findings], share: float, constants: Constants) -> Constants:
    """Limits each of which this share of quiet benches exceeds."""
    channels = np.array([f.by_channel for f in found])
    channels = channels[:, (channels > 0.0).all(axis=0)]
    gains = np.array([max((score(s) for s in f.singles), default=0.0) for f in found])
    ratios = np.array([f.ratio for f in found])
    return msgspec.structs.replace(
        constants,
        quiet_gain=_rounded(_beyond(gains, share)),
        quiet_ratio=_rounded(_beyond(ratios, share)),
        channel_ratio=_rounded(_beyond(channels.max(axis=1), share)),
    )


def _beyond(values: Array, share: float) -> float:
    """What a share of such values exceeds, where what exceeds their median falls off exponentially.

    The tail decides, and the lower half says nothing of it: "peaks over threshold" with the
    exponential of the generalised Pareto family (Pickands 1975).
    """
    middle = float(np.median(values))
    mean_excess = float(np.mean(values[values > middle] - middle)) if len(values) > 1 else middle
    return middle + mean_excess * float(np.log(0.5 / share))


def _rounded(value: float) -> float:
    return float(f"{value:.3g}")


def bare(found: Findings) -> Findings:
    """Findings without the rows that no rule reads."""
    return replace(
        found,
        singles=tuple(_without_rows(fit) for fit in found.singles),
        sets=tuple(_without_rows(fit) for fit in found.sets),
    )


def _without_rows(fit: Refined) -> Refined:
    return replace(fit, change=np.zeros(0), slopes=np.zeros((0, 0)))


@dataclass(frozen=True)
class Trials:
    """Log probability of the truth under every candidate set of constants, (sets, check-ups).

    NaN where a check-up is called quiet. `benches` says whose each check-up is.
    """

    constants: tuple[Constants, ...]
    scores: Array
    benches: tuple[str, ...]

    def best(self, without: str = "") -> Constants:
        """The set with the best mean over all benches but one."""
        kept = np.array([b != without for b in self.benches])
        means = np.nanmean(self.scores[:, kept], axis=1)
        return self.constants[int(np.argmax(means))]


def tried(judged: Sequence[Judged], constants: Constants) -> Trials:
    """Every candidate over all check-ups; limits of a quiet bench are those of `constants`."""
    asked = np.array([_asked(j, constants) for j in judged])
    changed = [j for j, own in zip(judged, asked, strict=True) if own]
    sizes, right = [sizes_of(j.findings) for j in changed], [_right(j) for j in changed]
    candidates, scores = [], []
    for form, free in product(SHARES, FREE):
        own = msgspec.structs.replace(constants, form_share=form, free_share=free)
        found = [evidence(j.findings.products, own) for j in changed]
        for parameters, further, left in ODDS:
            candidates.append(
                msgspec.structs.replace(
                    own, parameter_odds=parameters, further_odds=further, unknown_left=left
                )
            )
            scores.append(
                [
                    weighed(e, n, candidates[-1]) @ r
                    for e, n, r in zip(found, sizes, right, strict=True)
                ]
            )
    logs = np.full((len(candidates), len(judged)), np.nan)
    logs[:, asked] = np.log(np.maximum(np.array(scores), LEAST_PROBABILITY))
    return Trials(tuple(candidates), logs, tuple(j.bench for j in judged))


def _asked(j: Judged, constants: Constants) -> bool:
    """Whether a check-up says that something has changed, and has an entry for it."""
    return bool(j.findings.singles) and not is_quiet(j.findings, constants)


def _right(j: Judged) -> Array:
    """1 for what is the truth among the fits, parameters and unknown, else 0."""
    named = [set(map(canonical, fit.names)) == j.truth.names for fit in j.findings.fits]
    kinds = [j.truth.kind == "parameters", j.truth.kind == "unknown"]
    return np.array([*named, *kinds], float)


def left_out(trials: Trials, judged: Sequence[Judged]) -> Iterator[tuple[Judged, Constants]]:
    """Each check-up with the constants from all benches but its own."""
    for bench in sorted(set(trials.benches)):
        constants = trials.best(without=bench)
        for j in judged:
            if j.bench == bench:
                yield j, constants


def reliability(judged: Sequence[Judged], constants: Constants) -> Reliability:
    """How well the probabilities of one set of constants fit."""
    return reliability_of([(j, constants) for j in judged])


def reliability_of(judged: Sequence[tuple[Judged, Constants]]) -> Reliability:
    """The same, each check-up by constants of its own; quiet ones that are called quiet are out."""
    given, right, truths = [], [], []
    for j, constants in judged:
        if not _asked(j, constants):
            continue
        likely = hypotheses(j.findings, constants)
        truths.append(j.truth.probability(likely))
        given += [x.probability for x in likely]
        right += [float(j.truth.probability([_sure(x)]) > 0.0) for x in likely]
    p, r = np.array(given), np.array(right)
    rows = []
    for low, high in pairwise(_BINS):
        inside = (p >= low) & ((p < high) | (high == 1.0))
        if inside.any():
            rows.append((low, high, int(inside.sum()), float(p[inside].mean()),
                         float(r[inside].mean())))  # fmt: skip
    shares = np.array(truths) if truths else np.ones(1)
    said = [row for row in rows if row[0] >= _BINS[1]]
    weight = sum(row[2] for row in said)
    error = sum(row[2] * abs(row[3] - row[4]) for row in said) / max(weight, 1)
    log_score = float(np.mean(np.log(np.maximum(shares, LEAST_PROBABILITY))))
    return Reliability(len(truths), log_score, float(shares.mean()), error, tuple(rows))


def apart(judged: Sequence[Judged], constants: Constants) -> float:
    """How often a right best entry leaves less of a flexible correction than a wrong one does.

    Over all couples of a check-up with a right and one with a wrong best entry; NaN without any.
    """
    asked = [j for j in judged if _asked(j, constants)]
    right = [canonical(j.findings.singles[0].names[0]) in j.truth.names for j in asked]
    left = [evidence(j.findings.products, constants).left_by(0) for j in asked]
    couples = [
        (a < b) + 0.5 * (a == b)
        for a, good in zip(left, right, strict=True)
        if good
        for b, other in zip(left, right, strict=True)
        if not other
    ]
    return float(np.mean(couples)) if couples else float("nan")


def _sure(x: Likely) -> Likely:
    return Likely(x.names, 1.0)


def reliability_lines(title: str, found: Reliability) -> list[str]:
    """The reliability of check-ups as a table."""
    return [
        f"{title}: {found.count} called changed, mean probability of the truth "
        f"{found.on_truth:.2f}, mean logarithm of it {found.log_score:.2f}, "
        f"calibration error {found.error:.2f}",
        "  probability    answers  mean  right",
        *(
            f"  {low:.2f} to {high:.2f}  {count:>7}  {mean:.2f}  {share:.2f}"
            for low, high, count, mean, share in found.rows
        ),
    ]
