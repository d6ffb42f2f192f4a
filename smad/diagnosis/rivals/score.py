"""One score for every rival, and from it a probability in two levels: whether, and which.

A rival's score in run r and channel c is −log(v_rc + 1), v_rc being the mean square in floors that
it leaves of rows it was not fitted to. Where a floor holds what no simulator is trusted below, v_rc
is at least 1. (Else a lag of half a sample, which takes a current from 0.9 to 0.2 floors, counts as
much as one that takes an RTD from 30 floors to 17.) Thousands of rows do not contain the error of a
model's form, so the likelihood is tempered (a power posterior, Grünwald 2017): few independent
pieces of evidence, k, are counted for each run and channel, whatever its length,

    w(rival) = prior(rival) · exp(−k/2 · Σ_rc log(v_rc + 1)).

*Whether* anything is missing compares rivals with the simulator without a further part. That one
may be right, and what is right is not beaten: every independent row counts (κ₀) against it, until
something has entered, and after that in floors that hold what is not known of its form. Elsewhere
the error of form is in the simulator: k = κ. Every row counts there, too, between two of which one
leaves nothing that could be told and the other leaves more: what leaves more is wrong in form.

*Which* cause it is: the form of the likeliest is as likely right as wrong. Where it is right every
independent row counts, k = κ₀. Where all are wrong in form they are so the same way in every run:
k = κ / runs, so that more runs make no cause surer. The probability is the mean of the two. There a
rival also counts by how surely it leaves less than the simulator without a part: what explains
nothing is no cause. All are averaged over resampled runs (BayesBag, Huggins and Miller 2023): what
hangs on one run is not sure.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cache
from itertools import combinations_with_replacement
from math import factorial

import numpy as np

from smad.diagnosis.constants import Constants
from smad.diagnosis.plant import Array

_QUIET_SQUARE = 1.35**2
"""Mean square in floors that noise alone leaves at most: floors are known to a third."""
_FORM_RARELY = 0.01
"""How often an error of form has a larger square than counts as quiet."""
_RESAMPLED = 400
"""Of more runs than are enumerated; a mean probability is then known to 0.025 or better."""
_ENUMERATED = 8
"""Runs of which all resamples are taken: 6435 of eight, 24310 of nine."""
_SEED = 20261125

_LAWS = 20
"""Of the spring pair: a plant of fewer places holds the cause less often."""
NOTHING, PARAMETERS, EFFECT, LAW = "nothing", "parameters", "effect", "law"


def log_scores(squares: Array, counts: Array, least: float) -> Array:
    """−log(v + 1) of each run, summed over channels that it has, (runs,); v is at least `least`.

    `squares` and `counts` are (runs, channels): sums of squares in floors, and how many rows.
    """
    v = np.maximum(squares / np.maximum(counts, 1.0), least)
    return np.asarray(-np.where(counts > 0, np.log(v + 1.0), 0.0).sum(axis=1))


def effective_rows(rows: float, form_share: float, kappa: float, good: int) -> float:
    """Independent rows whose mean square is known as well as the ratio of a run's to its floor.

    The floor's square is noise, of which `rows` are independent, and in the share `form_share` the
    error of the model's form, of which κ are, in the run and in each of the `good` ones that the
    floor was found on.
    """
    of_form = form_share**2 / kappa * (1.0 + 1.0 / max(good, 1))
    return 1.0 / ((1.0 - form_share) ** 2 / rows + of_form)


def quiet_gap(form_share: float, kappa: float, good: int) -> float:
    """Floors over all signals that nothing new leaves at most, the errors of form among them."""
    from scipy.special import fdtri

    of_form = fdtri(kappa, kappa * max(good, 1), 1.0 - _FORM_RARELY)
    return float(np.sqrt((1.0 - form_share) * _QUIET_SQUARE + form_share * of_form))


def probabilities(
    scores: Array,
    kinds: Sequence[str],
    temper: Constants,
    *,
    effects: int,
    laws: int,
    log_prior: Array,
    rows: float,
    near: Sequence[bool],
    by_rows: bool,
) -> Array:
    """Probability of each rival, (rivals,), from `scores` (rivals, runs).

    `rows` is κ₀, the independent rows of a run and channel; `near` says which rivals leave nothing
    that could be told; `by_rows`: every row counts against those without a part.
    `effects` and `laws` are how many of each kind might have been asked: a prior is shared by all
    of them, asked or not, and by as many as the spring pair has. `log_prior` (rivals,) is that of
    where each one's parameters are: what imitates an effect by moving them far is less likely than
    the effect.
    """
    of_kind = {
        NOTHING: temper.nothing,
        PARAMETERS: temper.parameters,
        EFFECT: temper.each_effect(effects),
        LAW: -float(np.log(max(laws, _LAWS))),
    }
    prior = log_prior + np.array([of_kind[kind] for kind in kinds])
    times, chance = _draws(scores.shape[1])
    total = times @ scores.T
    of_run, of_rows = 0.5 * temper.evidence, 0.5 * rows
    of_which = of_run / scores.shape[1]
    part = np.isin(kinds, (EFFECT, LAW))
    of_same = of_rows if by_rows else of_run
    counts = (of_which, of_rows)
    if part.all():
        return np.asarray(chance @ _which(prior, total, counts))
    log_weight = prior + of_same * total
    if not part.any():
        return np.asarray(chance @ _shares(log_weight))
    best = total[:, ~part].max(axis=1, keepdims=True)
    lead = total[:, part] - best
    which = _which(prior[part] + _log_sigmoid(of_same * lead), lead, counts)
    sound, alone = np.asarray(near)[part], np.asarray(near)[~part].any()
    ahead = np.where(sound & ~alone, of_rows, of_same)
    behind = np.where(alone & ~sound, of_rows, of_run)
    counted = np.where(lead > 0.0, ahead, behind)
    log_odds = _log_sum(prior[part] + counted * lead) - _log_sum(
        log_weight[:, ~part] - of_same * best
    )
    out = np.empty_like(total)
    out[:, part] = np.exp(_log_sigmoid(log_odds)) * which
    out[:, ~part] = np.exp(_log_sigmoid(-log_odds)) * _shares(log_weight[:, ~part])
    return np.asarray(chance @ out)


@cache
def _draws(runs: int) -> tuple[Array, Array]:
    """How often each run is drawn, (resampled, runs), and with what chance, (resampled,).

    Of few runs they are all that there are, so that the order of runs does not matter.
    """
    if runs > _ENUMERATED:
        even = np.full(runs, 1.0 / runs)
        times = np.random.default_rng(_SEED).multinomial(runs, even, size=_RESAMPLED)
        return times.astype(np.float64), np.full(_RESAMPLED, 1.0 / _RESAMPLED)
    drawn = combinations_with_replacement(range(runs), runs)
    times = np.array([np.bincount(runs_drawn, minlength=runs) for runs_drawn in drawn])
    ways = np.array([factorial(k) for k in range(runs + 1)])
    return times.astype(np.float64), ways[runs] / ways[times].prod(axis=1) / runs**runs


def _which(log_prior: Array, scores: Array, counts: Sequence[float]) -> Array:
    """Which of some rivals it is, (resampled, rivals): the mean over how much evidence counts."""
    return np.asarray(np.mean([_shares(log_prior + k * scores) for k in counts], axis=0))


def _log_sum(log: Array) -> Array:
    """Log of the sum of weights in each row, (resampled, 1)."""
    return np.asarray(np.logaddexp.reduce(log, axis=1, keepdims=True))


def _log_sigmoid(x: Array) -> Array:
    """log(1 / (1 + exp(−x)))."""
    return np.asarray(-np.logaddexp(0.0, -x))


def _shares(log: Array) -> Array:
    """Weights of logs (resampled, rivals) that sum to 1 in each row."""
    return np.asarray(np.exp(log - _log_sum(log)))


def credible_set(probability: Mapping[str, float], level: float) -> list[str]:
    """The fewest names that together hold the `level`, the likeliest first."""
    ordered = sorted(probability.items(), key=lambda item: (-item[1], item[0]))
    before = np.cumsum([0.0, *(p for _, p in ordered)])[:-1]
    return [name for (name, _), so_far in zip(ordered, before, strict=True) if so_far < level]
