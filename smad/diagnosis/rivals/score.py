"""The score of a rival, and from it two probabilities: whether anything is missing, and which.

The score in run r and channel c is −n_rc/n̄ · log(v_rc + 1), where v_rc is the mean square, in
floors, of the residual on the n_rc rows that the rival was not fitted to, and n̄ the mean number of
them: a run that broke off counts less. Where a floor includes the resolution that no simulator is
trusted below, v_rc is at least 1. (Else a lag of half a sample, which takes a current from 0.9 to
0.2 floors, would count as much as one that takes an RTD from 30 floors to 17.)

The residuals of a wrong model are correlated over whole runs, so the likelihood is tempered (a
power posterior, Grünwald 2017): each run and channel counts as k independent observations,

    w(rival) = prior(rival) · exp(−k/2 · Σ_rc log(v_rc + 1)).

*Whether*: rivals are compared with the simulator without a new part. It may be exactly right, and
then no rival beats it: every independent row counts, k = κ₀, until a part has entered, and after
that in floors that include the form error of the parts. Elsewhere the simulator has a model error,
and k = κ. If only one of two rivals is at the floor, every row counts: the other is wrong in form.

*Which*: the form of the likeliest rival is taken as right or wrong with equal probability, and the
probability is the mean of the two. If it is right every independent row counts, k = κ₀. If all are
wrong, k = κ, but effects are compared with effects alone and laws with laws: a law has many shapes,
so what it leaves does not say whether the cause is one of the library. The two kinds then have
their prior probabilities. Rivals are weighted by the probability that they are better than the
simulator without a part, by what they leave and by the prior of their parameters.

All are averaged over resampled runs (BayesBag, Huggins and Miller 2023), so that no single run
decides.
"""

from collections.abc import Mapping, Sequence
from functools import cache
from itertools import combinations_with_replacement
from math import factorial

import numpy as np

from smad.diagnosis.constants import Constants
from smad.diagnosis.plant import Array

_QUIET_SQUARE = 1.35**2
"""Largest mean square of noise alone, in floors: floors are known to a third."""
_FORM_RARELY = 0.01
"""Probability that a model error exceeds what counts as quiet."""
_RESAMPLED = 400
"""Resamples of many runs; the standard error of a mean probability is then at most 0.025."""
_ENUMERATED = 8
"""Most runs of which all resamples are enumerated: 6435 of eight, 24310 of nine."""
_SEED = 20261125

_ALIKE = 8
"""Runs over which κ was fitted. If all forms are wrong they are wrong in the same way in every run:
more runs than these do not add certainty."""

_LAWS = 20
"""Laws of the spring pair: a plant with fewer places is less likely to have the right one."""
NOTHING, PARAMETERS, EFFECT, LAW = "nothing", "parameters", "effect", "law"


def log_scores(squares: Array, counts: Array, least_square: float) -> Array:
    """−n/n̄ · log(v + 1) of each run, summed over its channels, (runs,), v being `least_square` at
    least.

    `squares` and `counts` are (runs, channels): sums of squares in floors, and how many rows n. n̄
    is the mean of those that are not 0.
    """
    v = np.maximum(squares / np.maximum(counts, 1.0), least_square)
    weight = counts * (counts > 0).sum() / max(counts.sum(), 1.0)
    return np.asarray(-(weight * np.log(v + 1.0)).sum(axis=1))


def effective_rows(rows: float, form_share: float, kappa: float, good: int) -> float:
    """Number of independent rows whose mean square is known as well as that of a run in floors.

    The square of a floor is noise, with `rows` independent rows, and in the share `form_share`
    model error, with `kappa` of them in the run and in each of the `good` runs that gave the floor.
    """
    of_form = form_share**2 / kappa * (1.0 + 1.0 / max(good, 1))
    return 1.0 / ((1.0 - form_share) ** 2 / rows + of_form)


def quiet_gap(form_share: float, kappa: float, runs: int, good: int, tests: int = 1) -> float:
    """The largest gap, in floors, that noise and the known model error leave in so many `runs`.

    `form_share` is the mean of the channels' shares: their errors are taken to be alike, since what
    the model lacks acts on several of them. Each run, new or good, has `kappa` independent rows.
    The more `tests`, the higher is the limit of each: all together are as seldom wrong as one.
    """
    from scipy.special import fdtri

    of_form = fdtri(kappa * runs, kappa * max(good, 1), 1.0 - _FORM_RARELY / tests)
    return float(np.sqrt((1.0 - form_share) * _QUIET_SQUARE + form_share * of_form))


def probabilities(
    scores: Array,
    kinds: Sequence[str],
    constants: Constants,
    *,
    effects: int,
    laws: int,
    log_prior: Array,
    rows: float,
    at_floor: Sequence[bool],
    by_rows: bool,
    enumerated: int = _ENUMERATED,
) -> Array:
    """Probability of each rival, (rivals,), from `scores` (rivals, runs).

    `rows` is κ₀, the independent rows of a run and channel; `at_floor` says which rivals have every
    channel at its floor; `by_rows`: every row counts against those without a part. The prior of a
    kind is shared by the number of its candidates, `effects` or `laws`, or by that of the spring
    pair if it is larger. `log_prior` (rivals,) is that of each one's parameters: parameters that
    move far to imitate an effect are less likely than the effect. Of more runs than `enumerated` a
    sample of their resamples is taken.
    """
    of_kind = {
        NOTHING: constants.nothing,
        PARAMETERS: constants.parameters,
        EFFECT: constants.each_effect(effects),
        LAW: -float(np.log(max(laws, _LAWS))),
    }
    prior = log_prior + np.array([of_kind[kind] for kind in kinds])
    times, chance = _resamples(scores.shape[1], enumerated)
    total = times @ scores.T
    of_run, of_rows = 0.5 * constants.evidence, 0.5 * rows
    part = np.isin(kinds, (EFFECT, LAW))
    kind_of_part = np.array(kinds)[part]
    of_same = of_rows if by_rows else of_run
    of_wrong = of_run * min(_ALIKE / scores.shape[1], 1.0)

    def of_parts(log_before: Array, score: Array) -> Array:
        """Probabilities of the rivals with a part, (resamples, rivals), from their prior and score:
        the mean of those if the form of the likeliest is right, and if all are wrong."""
        right = _softmax(log_before + of_rows * score)
        log_wrong = np.broadcast_to(log_before + of_wrong * score, score.shape).copy()
        for kind, count in ((EFFECT, effects), (LAW, laws)):
            if (alike := kind_of_part == kind).any():
                of_all = of_kind[kind] + float(np.log(max(count, 1)))
                log_wrong[:, alike] += of_all - _log_sum_exp(log_wrong[:, alike])
        return np.asarray(0.5 * (right + _softmax(log_wrong)))

    if part.all():
        return np.asarray(chance @ of_parts(prior, total))
    log_weight = prior + of_same * total
    if not part.any():
        return np.asarray(chance @ _softmax(log_weight))
    best = total[:, ~part].max(axis=1, keepdims=True)
    lead = total[:, part] - best
    of_best = log_prior[~part][total[:, ~part].argmax(axis=1)][:, None]
    log_ratio = of_same * lead + log_prior[part] - of_best
    which = of_parts(prior[part] + _log_sigmoid(log_ratio), lead)
    sound, alone = np.asarray(at_floor)[part], np.asarray(at_floor)[~part].any()
    ahead = np.where(sound & ~alone, of_rows, of_same)
    behind = np.where(alone & ~sound, of_rows, of_run)
    counted = np.where(lead > 0.0, ahead, behind)
    log_odds = _log_sum_exp(prior[part] + counted * lead) - _log_sum_exp(
        log_weight[:, ~part] - of_same * best
    )
    out = np.empty_like(total)
    out[:, part] = np.exp(_log_sigmoid(log_odds)) * which
    out[:, ~part] = np.exp(_log_sigmoid(-log_odds)) * _softmax(log_weight[:, ~part])
    return np.asarray(chance @ out)


@cache
def _resamples(runs: int, enumerated: int) -> tuple[Array, Array]:
    """How often each run is drawn, (resamples, runs), and the probability of that, (resamples,).

    All resamples of few runs are enumerated, so that the order of the runs does not matter.
    """
    if runs > enumerated:
        even = np.full(runs, 1.0 / runs)
        times = np.random.default_rng(_SEED).multinomial(runs, even, size=_RESAMPLED)
        return times.astype(np.float64), np.full(_RESAMPLED, 1.0 / _RESAMPLED)
    drawn = combinations_with_replacement(range(runs), runs)
    times = np.array([np.bincount(runs_drawn, minlength=runs) for runs_drawn in drawn])
    ways = np.array([factorial(k) for k in range(runs + 1)])
    return times.astype(np.float64), ways[runs] / ways[times].prod(axis=1) / runs**runs


def _log_sum_exp(log: Array) -> Array:
    """Log of the sum of weights in each row, (resampled, 1)."""
    # This and the next take 0.4 of the time of `np.logaddexp`.
    largest = log.max(axis=1, keepdims=True)
    return np.asarray(largest + np.log(np.exp(log - largest).sum(axis=1, keepdims=True)))


def _log_sigmoid(x: Array) -> Array:
    """log(1 / (1 + exp(−x)))."""
    return np.asarray(np.minimum(x, 0.0) - np.log1p(np.exp(-np.abs(x))))


def _softmax(log: Array) -> Array:
    """Weights of logs (resampled, rivals) that sum to 1 in each row."""
    return np.asarray(np.exp(log - _log_sum_exp(log)))


def credible_set(probability: Mapping[str, float], level: float) -> list[str]:
    """The fewest names that together hold the `level`, the likeliest first."""
    ordered = sorted(probability.items(), key=lambda item: (-item[1], item[0]))
    before = np.cumsum([0.0, *(p for _, p in ordered)])[:-1]
    return [name for (name, _), so_far in zip(ordered, before, strict=True) if so_far < level]
