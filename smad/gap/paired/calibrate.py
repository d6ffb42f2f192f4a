"""The constants of a check-up's decision from benches whose truth is known.

Limits of a quiet bench are quantiles of what quiet benches show. What turns scores into
probabilities is chosen by the mean log probability of the truth. How good that is, is told by
leaving out one bench after the other.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise, product
from statistics import NormalDist

import msgspec
import numpy as np

from smad.gap.paired.constants import Constants
from smad.gap.paired.difference import Paired
from smad.gap.paired.judge import Findings, examine, score, stepped
from smad.gap.paired.refine import Refined
from smad.gap.paired.verdict import Likely, hypotheses, is_quiet
from smad.gap.plant import Array

FALSE_ALARMS = 1.0 / 60.0
"""Of quiet benches, one in so many may be called changed, over all three limits together."""
_LIMITS = 3
FORMS = (1.0, 2.0)
FURTHER = (50.0, 100.0, 200.0, 400.0, 800.0, 1600.0)
TEMPERS = (1.0, 2.0, 4.0, 8.0, 16.0, 32.0)
SHARES = (0.05, 0.1, 0.15, 0.2, 0.3, 0.45)
LEFT = (0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8)
LEAST_PROBABILITY = 1e-3
_BINS = (0.0, 0.2, 0.4, 0.6, 0.8, 0.95, 1.0)


@dataclass(frozen=True)
class Truth:
    """What was the matter: `quiet`, `parameters`, `unknown`, or the entries at work as `names`."""

    kind: str
    names: frozenset[str] = frozenset()

    def probability(self, likely: Sequence[Likely]) -> float:
        """What a check-up gave to the truth; a set counts when it is named whole."""
        right = self.names or {self.kind}
        return sum(x.probability for x in likely if frozenset(x.names) == right)


@dataclass(frozen=True)
class Known:
    """A check-up of a bench whose truth is known."""

    bench: str
    truth: Truth
    paired: Paired


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
    """The limits of a quiet bench, from those that are; a logarithm is taken to be normal."""
    found = [j.findings for j in judged if j.truth.kind == "quiet"]
    each = FALSE_ALARMS / _LIMITS
    channels = np.array([f.by_channel for f in found])
    channels = channels[:, (channels > 0.0).all(axis=0)]
    gains = [max((score(s) for s in f.singles), default=0.0) for f in found]
    return msgspec.structs.replace(
        constants,
        # A gain is what a fit takes of many rows that are nearly 1: its size follows from theirs.
        quiet_gain=_rounded(_beyond(np.maximum(gains, 1.0), each)),
        quiet_ratio=_rounded(_beyond(np.array([f.ratio for f in found]), each)),
        channel_ratio=_rounded(_beyond(channels.max(axis=1), each)),
    )


def _beyond(values: Array, share: float) -> float:
    """What a share of such values exceeds."""
    logs = np.log(np.asarray(values, float))
    spread = float(np.std(logs, ddof=1)) if len(logs) > 1 else 0.5
    return float(np.exp(np.mean(logs) + NormalDist().inv_cdf(1.0 - share) * spread))


def _rounded(value: float) -> float:
    return float(f"{value:.3g}")


def examined(case: Known, constants: Constants) -> dict[float, Judged]:
    """A check-up under each of `FORMS`, without the rows that no rule reads."""
    found = examine(case.paired, constants)
    out = {}
    for form in FORMS:
        own = msgspec.structs.replace(constants, further_form=form)
        again = stepped(case.paired, found, own)
        out[form] = Judged(case.bench, case.truth, _bare(again))
    return out


def _bare(found: Findings) -> Findings:
    return replace(
        found,
        screened=(),
        singles=tuple(_without_rows(fit) for fit in found.singles),
        steps=tuple(_without_rows(fit) for fit in found.steps),
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


def tried(by_form: Sequence[tuple[Constants, Sequence[Judged]]]) -> Trials:
    """Every candidate over all check-ups, which were examined once for each `further_form`."""
    constants, scores = [], []
    for own, judged in by_form:
        for candidate in _grid(own):
            constants.append(candidate)
            scores.append([_log_probability(j, candidate) for j in judged])
    return Trials(tuple(constants), np.array(scores), tuple(j.bench for j in by_form[0][1]))


def _grid(constants: Constants) -> Iterator[Constants]:
    for temper, share, left, gain in product(TEMPERS, SHARES, LEFT, FURTHER):
        yield msgspec.structs.replace(
            constants, temper=temper, form_share=share, unknown_left=left, further_gain=gain
        )


def _log_probability(j: Judged, constants: Constants) -> float:
    if is_quiet(j.findings, constants):
        return float("nan")
    given = j.truth.probability(hypotheses(j.findings, constants))
    return float(np.log(max(given, LEAST_PROBABILITY)))


def left_out(
    trials: Trials, by_form: Sequence[tuple[Constants, Sequence[Judged]]]
) -> Iterator[tuple[Judged, Constants]]:
    """Each check-up with the constants from all benches but its own."""
    form_of = {c.further_form: judged for c, judged in by_form}
    for bench in sorted(set(trials.benches)):
        constants = trials.best(without=bench)
        for j in form_of[constants.further_form]:
            if j.bench == bench:
                yield j, constants


def reliability(judged: Sequence[Judged], constants: Constants) -> Reliability:
    """How well the probabilities of one set of constants fit."""
    return reliability_of([(j, constants) for j in judged])


def reliability_of(judged: Sequence[tuple[Judged, Constants]]) -> Reliability:
    """The same, each check-up by constants of its own; quiet ones that are called quiet are out."""
    given, right, truths = [], [], []
    for j, constants in judged:
        if is_quiet(j.findings, constants) or not j.findings.singles:
            continue
        likely = hypotheses(j.findings, constants)
        truths.append(j.truth.probability(likely))
        given += [x.probability for x in likely]
        right += [float(j.truth.probability([_sure(x)]) > 0.0) for x in likely]
    return measured(given, right, truths)


def measured(
    given: Sequence[float], right: Sequence[float], truths: Sequence[float]
) -> Reliability:
    """How well probabilities fit: those `given` to answers, each 1 in `right` if it was, else 0.

    `truths` are what the truth was given, one for each question.
    """
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


def apart(judged: Sequence[Judged]) -> float:
    """How often a right first entry leaves less of a flexible correction than a wrong one does.

    Over all couples of a check-up with a right and one with a wrong first entry; NaN without any.
    """
    asked = [j for j in judged if j.findings.steps]
    right = [j.findings.steps[0].names[0] in j.truth.names for j in asked]
    left = [j.findings.left_by(0) for j in asked]
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
    return reliability_table(f"{title}: {found.count} called changed, ", found)


def reliability_table(head: str, found: Reliability) -> list[str]:
    """A reliability as a table; `head` begins its first line."""
    return [
        f"{head}mean probability of the truth {found.on_truth:.2f}, mean logarithm of it "
        f"{found.log_score:.2f}, calibration error {found.error:.2f}",
        "  probability    answers  mean  right",
        *(
            f"  {low:.2f} to {high:.2f}  {count:>7}  {mean:.2f}  {share:.2f}"
            for low, high, count, mean, share in found.rows
        ),
    ]
