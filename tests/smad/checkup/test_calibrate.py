"""Constants from benches whose truth is known."""

from dataclasses import replace

import numpy as np
import pytest

from smad.checkup.calibrate import (
    Judged,
    Truth,
    apart,
    left_out,
    quiet_limits,
    reliability,
    reliability_lines,
    tried,
)
from smad.checkup.constants import Constants
from smad.checkup.evidence import Products, evidence
from smad.checkup.judge import Findings
from smad.checkup.verdict import hypotheses, is_quiet
from smad.diagnosis.plant import Effect
from smad.diagnosis.search.refine import Refined

from .short import PLANT

BEFORE = Constants(
    quiet_gain=100.0, quiet_ratio=1.6, channel_ratio=3.0, form_share=0.35,
    free_share=0.25, parameter_odds=10.0, further_odds=0.01, unknown_left=0.6, odds=3.0,
)  # fmt: skip
BY_NAME = {e.name: e for e in PLANT.effects}


def fit(effect: Effect, gain: float) -> Refined:
    none = np.zeros(1)
    return Refined((effect,), {effect.name: {}}, gain, none, none[None], none, ())


def nested(gains: list[float], *, singles: int, left: float) -> Products:
    """Products of fits, each weaker one a part of the stronger, none along a parameter."""
    taken = np.array([0.0, *gains])
    rows = np.minimum.outer(taken, taken)
    rows[0, :] = rows[:, 0] = taken
    beyond = max(gains[:singles]) * left / (1.0 - left)
    none = np.zeros((0, len(taken)))
    return Products(rows, none, np.zeros(0), np.zeros(len(gains)), singles, beyond)


def found(gains: dict[str, float], *, ratio: float = 5.0, left: float = 0.1) -> Findings:
    """What a check-up with these gains would have found."""
    singles = tuple(sorted((fit(BY_NAME[n], g) for n, g in gains.items()), key=lambda s: -s.gain))
    own = nested([s.gain for s in singles], singles=len(singles), left=left)
    return Findings(
        count=1000, ratio=ratio, by_channel=np.full(3, ratio), by_run=np.ones(1),
        singles=singles, sets=(), products=own,
    )  # fmt: skip


def judged(seed: int, *, swap: float) -> list[Judged]:
    """Check-ups of four benches, in a share of which the neighbour's score is the better one."""
    rng = np.random.default_rng(seed)
    out = []
    for k in range(24):
        names = ["rtd_lag", "driver_gain"]
        right = str(rng.choice(names))
        other = next(n for n in names if n != right)
        first, second = (other, right) if rng.uniform() < swap else (right, other)
        gains = {first: 2000.0, second: 1900.0}
        out.append(Judged(f"bench-{k % 4}", Truth("effects", frozenset((right,))), found(gains)))
    return out


def quiet(rng: np.random.Generator, bench: str, heavy: float) -> Judged:
    """A check-up without a change; a share of days is `heavy`, more than a logarithm is normal."""
    factor = 3.0 if rng.uniform() < heavy else 1.0
    one = found({"rtd_lag": factor * float(np.exp(rng.normal(2.0, 0.8)))},
                ratio=factor * float(np.exp(rng.normal(0.0, 0.2))))  # fmt: skip
    return Judged(bench, Truth("quiet"), one)


@pytest.mark.parametrize("heavy", [0.0, 0.05])
def test_one_quiet_bench_in_sixty_is_called_changed(heavy: float) -> None:
    rng = np.random.default_rng(5)
    limits = quiet_limits([quiet(rng, f"bench-{k % 40}", heavy) for k in range(400)], BEFORE)
    alarms = [not is_quiet(quiet(rng, "", heavy).findings, limits) for _ in range(3000)]
    assert 0.001 < np.mean(alarms) < 0.03


@pytest.mark.parametrize("swap", [0.0, 0.4])
def test_probabilities_become_as_sure_as_the_names_are_right(swap: float) -> None:
    cases = judged(7, swap=swap)
    after = tried(cases, BEFORE).best()
    told = reliability(cases, after)
    assert told.on_truth == pytest.approx(1.0 - swap if swap else 1.0, abs=0.15)
    assert told.log_score >= reliability(cases, BEFORE).log_score
    assert told.error < 0.15


def test_a_bench_that_is_left_out_is_told_with_the_constants_of_the_others() -> None:
    cases = judged(9, swap=0.3)
    trials = tried(cases, BEFORE)
    told = list(left_out(trials, cases))
    assert sorted(j.bench for j, _ in told) == sorted(j.bench for j in cases)
    assert all(c == trials.best(without=j.bench) for j, c in told)


def test_a_reliability_is_told_as_a_table() -> None:
    head, titles, *rows = reliability_lines("before", reliability(judged(3, swap=0.2), BEFORE))
    assert head.startswith("before: 24 called changed")
    assert "right" in titles
    assert sum(int(row.split()[3]) for row in rows) == 4 * 24


def test_right_and_wrong_entries_are_apart_by_what_they_leave() -> None:
    def leaving(right: str, left: float) -> Judged:
        truth = Truth("effects", frozenset((right,)))
        return Judged("bench-1", truth, found({"rtd_lag": 2000.0}, left=left))

    cases = [leaving("rtd_lag", 0.1), leaving("rtd_lag", 0.5), leaving("driver_gain", 0.4)]
    assert apart(cases, BEFORE) == pytest.approx(0.5)


def grown(taken: float) -> Findings:
    """What a check-up found whose best entry grew by one that takes so much."""
    one = found({"rtd_lag": 2000.0})
    both = (BY_NAME["rtd_lag"], BY_NAME["driver_gain"])
    pair = replace(one.singles[0], effects=both, gain=2000.0 + taken)
    own = nested([2000.0, pair.gain], singles=1, left=0.1)
    return replace(one, sets=(pair,), products=own)


def test_a_further_name_is_said_where_its_evidence_outweighs_its_prior() -> None:
    variance = 1.0 + BEFORE.form_share**2 * 2000.0
    needed = -2.0 * variance * np.log(BEFORE.further_odds)
    for taken, names in ((0.5 * needed, ["rtd_lag"]), (2.0 * needed, ["rtd_lag", "driver_gain"])):
        told = hypotheses(grown(taken), BEFORE)
        assert told[0].names == names
        shared = [x.probability for x in told if x.names[0] == "rtd_lag"]
        assert len(shared) == 2
        assert sum(x.probability for x in told) == pytest.approx(1.0)


def test_parameters_win_where_the_difference_lies_along_them() -> None:
    """The same rows, across the directions of parameters and along one of them."""
    rows, none = np.array([[2000.0, 800.0], [800.0, 320.0]]), np.zeros((0, 2))
    across = Products(rows, none, np.zeros(0), np.zeros(1), singles=1, beyond=0.0)
    along = replace(across, along=np.sqrt([[2000.0, 320.0]]), squares=np.array([1e6]))
    one = found({"rtd_lag": 1280.0})
    for own, first in ((across, "rtd_lag"), (along, "parameters")):
        assert hypotheses(replace(one, products=own), BEFORE)[0].names == [first]


def test_evidence_of_the_form_of_a_law_does_not_grow_without_end() -> None:
    """A neighbour that takes nine tenths stays as likely, however strong the effect is."""
    odds = []
    for gain in (1e4, 1e6):
        sets = evidence(nested([gain, 0.9 * gain], singles=2, left=0.0), BEFORE).sets
        odds.append(sets[0] - sets[1])
    assert odds[1] == pytest.approx(odds[0], rel=0.02)


def test_what_a_flexible_correction_takes_far_more_of_is_unknown() -> None:
    limit = BEFORE.unknown_left
    for left, first in ((0.5 * limit, "rtd_lag"), (0.5 + 0.5 * limit, "unknown")):
        assert hypotheses(found({"rtd_lag": 2000.0}, left=left), BEFORE)[0].names == [first]
