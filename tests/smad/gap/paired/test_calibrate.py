"""Constants from benches whose truth is known."""

from dataclasses import replace

import numpy as np
import pytest

from smad.gap.paired.calibrate import (
    Judged,
    Truth,
    apart,
    left_out,
    quiet_limits,
    reliability,
    reliability_lines,
    tried,
)
from smad.gap.paired.constants import shipped_constants
from smad.gap.paired.judge import Findings
from smad.gap.paired.refine import Refined
from smad.gap.paired.verdict import hypotheses, is_quiet
from smad.gap.plant import Effect

from .short import PLANT

BEFORE = shipped_constants()
BY_NAME = {e.name: e for e in PLANT.effects}


def fit(effect: Effect, gain: float) -> Refined:
    none = np.zeros(1)
    return Refined((effect,), {effect.name: {}}, gain, none, none[None], none, ())


def found(gains: dict[str, float], *, ratio: float = 5.0, left: float = 0.1) -> Findings:
    """What a check-up with these gains would have found."""
    singles = tuple(sorted((fit(BY_NAME[n], g) for n, g in gains.items()), key=lambda s: -s.gain))
    return Findings(
        count=1000, ratio=ratio, by_channel=np.full(3, ratio), by_run=np.ones(1),
        parameters=0.0, parameter_odds=0.0, screened=(), singles=singles, steps=singles[:1],
        beyond=(), flexible=(singles[0].gain / (1.0 - left),),
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


def test_one_quiet_bench_in_sixty_is_called_changed() -> None:
    rng = np.random.default_rng(5)

    def quiet() -> Judged:
        one = found({"rtd_lag": float(np.exp(rng.normal(2.0, 0.8)))},
                    ratio=float(np.exp(rng.normal(0.0, 0.2))))  # fmt: skip
        return Judged("bench-1", Truth("quiet"), one)

    limits = quiet_limits([quiet() for _ in range(300)], BEFORE)
    alarms = [not is_quiet(quiet().findings, limits) for _ in range(3000)]
    assert 0.002 < np.mean(alarms) < 0.04


@pytest.mark.parametrize("swap", [0.0, 0.4])
def test_probabilities_become_as_sure_as_the_names_are_right(swap: float) -> None:
    cases = judged(7, swap=swap)
    after = tried([(BEFORE, cases)]).best()
    told = reliability(cases, after)
    assert told.on_truth == pytest.approx(1.0 - swap if swap else 1.0, abs=0.15)
    assert told.log_score >= reliability(cases, BEFORE).log_score
    assert told.error < 0.15


def test_a_bench_that_is_left_out_is_told_with_the_constants_of_the_others() -> None:
    cases = judged(9, swap=0.3)
    by_form = [(BEFORE, cases)]
    trials = tried(by_form)
    told = list(left_out(trials, by_form))
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
    assert apart(cases) == pytest.approx(0.5)


def grown(taken: float) -> Findings:
    """What a check-up found whose best entry grew by one that takes so much."""
    one = found({"rtd_lag": 2000.0})
    both = (BY_NAME["rtd_lag"], BY_NAME["driver_gain"])
    pair = replace(one.singles[0], effects=both, gain=2000.0 + taken)
    return replace(
        one, steps=(*one.singles, pair), beyond=(taken,), flexible=(*one.flexible, pair.gain)
    )


def test_a_further_name_is_said_where_it_takes_more_than_it_must() -> None:
    needed = BEFORE.further_gain
    for taken, names in ((0.3 * needed, ["rtd_lag"]), (3.0 * needed, ["rtd_lag", "driver_gain"])):
        told = hypotheses(grown(taken), BEFORE)
        assert told[0].names == names
        shared = [x.probability for x in told if x.names[0] == "rtd_lag"]
        assert len(shared) == 2
        assert sum(x.probability for x in told) == pytest.approx(1.0)


def test_what_a_flexible_correction_takes_far_more_of_is_unknown() -> None:
    limit = BEFORE.unknown_left
    for left, first in ((0.5 * limit, "rtd_lag"), (0.5 + 0.5 * limit, "unknown")):
        assert hypotheses(found({"rtd_lag": 2000.0}, left=left), BEFORE)[0].names == [first]
