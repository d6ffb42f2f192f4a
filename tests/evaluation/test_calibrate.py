"""Constants come from cases: limits from quiet benches, odds from what was right."""

from __future__ import annotations

import numpy as np
import pytest

from evaluation.calibrate.check_up import Case, chosen, report
from evaluation.errors import BankError
from evaluation.score.answers import CaseKey, TrueEffect
from smad.diagnosis.constants import shipped
from smad.diagnosis.search.odds import Hypothesis


def case(
    bench: int,
    kind: str,
    *,
    gain: float,
    parameters: float | None = None,
    found: tuple[Hypothesis, ...] = (),
) -> Case:
    """A check-up whose truth, where it has an effect, is rtd_lag at reading_rtd."""
    known = kind == "single"
    lag = TrueEffect(name="rtd_lag" if known else "slow glue", places=["reading_rtd"], states=[],
                     side="both", known=known)  # fmt: skip
    effects = [lag] if kind in ("single", "unknown") else []
    return Case(
        bench=f"bench {bench}", truth=CaseKey(kind=kind, effects=effects),
        ratio=0.5, gain=gain, explained=gain, count=10_000,
        parameters=min(gain, 50.0) if parameters is None else parameters,
        hypotheses=found,
    )  # fmt: skip


def hypotheses(right: float, wrong: float) -> tuple[Hypothesis, ...]:
    """A law and the effect at the right place, and a law at a wrong one, by what they take."""
    return (
        Hypothesis(place="reading_rtd", gains=np.array([right])),
        Hypothesis(place="film", gains=np.array([wrong])),
        Hypothesis(place="reading_rtd", effect="rtd_lag", gains=np.array([right])),
    )


def cases(listed: int, unlisted: int) -> list[Case]:
    rng = np.random.default_rng(3)
    out = [case(n % 6, "none", gain=float(g)) for n, g in enumerate(rng.exponential(20.0, 60))]
    for n in range(listed + unlisted):
        kind = "single" if n < listed else "unknown"
        wrong = float(rng.uniform(0.1, 0.9)) * 1e5
        out.append(case(n % 6, kind, gain=1e5, found=hypotheses(1e5, wrong)))
    # Of what parameters of 1e4, 1e5 and 1e6 leave, a law takes a twentieth of the root of 1e4 rows.
    for n, size in enumerate((1e4, 1e5, 1e6)):
        for bench in range(6):
            gain = (0.04 + 0.004 * n) * np.sqrt(size * 1e4)
            out.append(case(bench, "parameters", gain=gain, parameters=size))
    return out


def test_the_limit_of_a_quiet_bench_lies_beyond_what_quiet_benches_show() -> None:
    some = cases(20, 10)
    found = chosen(some, shipped())
    quiet = [x.gain for x in some if x.truth.kind == "none"]
    assert found.quiet_gain > np.quantile(quiet, 0.95)
    assert found.quiet_gain < 3.0 * max(quiet)


def test_the_odds_of_an_effect_are_as_often_as_it_was_one() -> None:
    often, seldom = chosen(cases(40, 10), shipped()), chosen(cases(10, 40), shipped())
    assert often.effect_odds > seldom.effect_odds
    probability = [
        dict(zip(("law", "wrong", "effect"), x.odds(often), strict=True))["effect"]
        for x in cases(40, 10)
        if x.truth.effects
    ]
    assert np.mean(probability) == pytest.approx(0.8, abs=0.08)


def test_changed_parameters_are_told_from_effects_by_what_a_law_takes_beside_them() -> None:
    some = cases(20, 10)
    some += [case(n % 6, "single", gain=2e4, parameters=1e6, found=hypotheses(2e4, 1e3))
             for n in range(6)]  # fmt: skip
    c = chosen(some, shipped())
    assert 0.048 < c.parameters_form < 0.2
    moved = [x for x in some if x.truth.kind == "parameters"]
    assert all(x.of_parameters(c) for x in moved)
    assert not any(x.of_parameters(c) for x in some if x.truth.kind == "single")


@pytest.mark.parametrize("kind", ["none", "parameters"])
def test_banks_that_lack_a_kind_are_refused(kind: str) -> None:
    some = [x for x in cases(20, 10) if x.truth.kind != kind]
    with pytest.raises(BankError, match="constants are fitted to"):
        chosen(some, shipped())


def test_places_hold_the_truth_as_often_as_they_should() -> None:
    some = cases(40, 20)
    c = chosen(some, shipped())
    said = dict(report([(x, c) for x in some]))
    assert said["told places hold the truth, listed"] == "40 of 40"
    assert said["quiet benches called changed"].endswith(" of 60")
    assert any(what.startswith("place with probability") for what in said)
