"""From a diagnosis to the words of a verdict file: probabilities, quantities."""

from __future__ import annotations

import msgspec
import pytest
from smad.gap.records import Outcome, ValueRecord, Verdict

from smad.diagnosis.bank.answer import COMPARABLE, hypotheses, quantities
from smad.diagnosis.spring_pair import SmaPlant

EMPTY = Verdict(
    outcome=Outcome.EFFECT, effects=["rtd_lag"], group=[], sub_model="sensors", regimes=[],
    probability=0.81, probabilities={}, gap_raw=5.0, gap_refit=4.0, gap_final=1.0, shrink=0.75,
    shrink_low=0.7, shrink_high=0.8, ceiling=0.8, open_loop=[], text="",
)  # fmt: skip


def _verdict(outcome: Outcome, probability: float, *effects: str, group: tuple[str, ...] = ()
             ) -> Verdict:  # fmt: skip
    return msgspec.structs.replace(
        EMPTY, outcome=outcome, probability=probability, effects=list(effects), group=list(group)
    )


def _said(verdict: Verdict, places: dict[str, dict[str, float]]) -> dict[frozenset[str], float]:
    found = hypotheses(verdict, places)
    order = [h.probability for h in found]
    assert order == sorted(order, reverse=True)
    assert sum(order) <= 1.0 + 1e-9
    return {frozenset(h.names): h.probability for h in found}


def test_what_is_unknown_is_taken_off_every_named_cause_in_proportion() -> None:
    places = {"rtd_lag": {"rtd_lag": 0.9, "channel_delay": 0.08, "": 0.02}}
    said = _said(_verdict(Outcome.EFFECT, 0.81, "rtd_lag"), places)
    assert said == pytest.approx(
        {
            frozenset({"rtd_lag"}): 0.81,
            frozenset({"channel_delay"}): 0.072,
            frozenset({"parameters"}): 0.018,
            frozenset({"unknown"}): 0.1,
        }
    )


def test_a_verdict_that_names_a_cause_has_it_first_however_unsure_it_is() -> None:
    places = {"rtd_lag": {"rtd_lag": 0.9, "channel_delay": 0.1}}
    said = _said(_verdict(Outcome.EFFECT, 0.4, "rtd_lag"), places)
    assert next(iter(said)) == frozenset({"rtd_lag"})
    assert said[frozenset({"unknown"})] < said[frozenset({"rtd_lag"})] == pytest.approx(0.4)


def test_a_group_carries_the_probability_of_its_members_together() -> None:
    places = {"rtd_lag": {"rtd_lag": 0.6, "channel_delay": 0.4}}
    verdict = _verdict(Outcome.AMBIGUOUS, 1.0, "rtd_lag", group=("channel_delay",))
    assert _said(verdict, places) == pytest.approx(
        {frozenset({"rtd_lag"}): 0.6, frozenset({"channel_delay"}): 0.4}
    )


def test_two_places_give_sets_of_two_with_the_product_of_their_shares() -> None:
    places = {
        "rtd_lag": {"rtd_lag": 0.9, "rtd_stem": 0.1},
        "tube_friction": {"tube_friction": 0.8, "viscous_drag": 0.2},
    }
    said = _said(_verdict(Outcome.EFFECT, 0.9, "rtd_lag", "tube_friction"), places)
    assert said[frozenset({"rtd_lag", "tube_friction"})] == pytest.approx(0.72)
    assert said[frozenset({"rtd_stem", "viscous_drag"})] == pytest.approx(0.02)
    assert sum(said.values()) == pytest.approx(1.0)
    first = hypotheses(_verdict(Outcome.EFFECT, 0.9, "tube_friction", "rtd_lag"), places)[0]
    assert first.names == ["tube_friction", "rtd_lag"]


@pytest.mark.parametrize(
    ("outcome", "word"), [(Outcome.NO_GAP, "none"), (Outcome.PARAMETERS, "parameters")]
)
def test_a_quiet_verdict_says_so_first_and_shares_the_rest(outcome: Outcome, word: str) -> None:
    places = {"": {"": 0.7, "rtd_lag": 0.2, "rtd_stem": 0.1}}
    assert _said(_verdict(outcome, 0.94), places) == pytest.approx(
        {frozenset({word}): 0.94, frozenset({"rtd_lag"}): 0.04, frozenset({"rtd_stem"}): 0.02}
    )


def test_an_unknown_cause_has_its_own_probability() -> None:
    said = _said(_verdict(Outcome.UNKNOWN, 0.95), {"": {"": 0.5, "rtd_lag": 0.5}})
    assert said[frozenset({"unknown"})] == pytest.approx(0.95)
    assert said[frozenset({"rtd_lag"})] == pytest.approx(0.025)


def test_an_unknown_cause_stands_first_however_unsure_that_is() -> None:
    places = {"rtd_lag": {"rtd_lag": 0.9, "": 0.1}}
    said = _said(_verdict(Outcome.UNKNOWN, 0.3), places)
    assert next(iter(said)) == frozenset({"unknown"})
    assert said[frozenset({"unknown"})] == pytest.approx(0.3)
    assert said[frozenset({"rtd_lag"})] == pytest.approx(0.24)


def test_without_excitation_nothing_is_claimed() -> None:
    assert hypotheses(_verdict(Outcome.NO_EXCITATION, 0.9), {}) == []


def _value(
    effect: str, name: str, value: float, interval: tuple[float, float], before: float = 0.0
) -> ValueRecord:
    return ValueRecord(effect, name, "", value, before, *interval, False, True, [])


def test_quantities_are_changes_since_the_good_runs_in_the_units_of_the_bank() -> None:
    found = quantities(
        [
            _value("encoder_backlash", "width_m", 3e-4, (2.5e-4, 3.4e-4), before=1e-4),
            _value("tube_friction", "coulomb_N", 0.1, (0.05, 0.2)),
        ]
    )
    assert set(found) == {"encoder_backlash"}
    q = found["encoder_backlash"]
    assert (q.value, q.low, q.high) == pytest.approx((0.2, 0.15, 0.24))


def test_a_fall_turns_the_interval_of_a_rise_over() -> None:
    q = quantities([_value("transformation_fatigue", "shift_K", -0.4, (-0.5, -0.2))])
    found = q["transformation_fatigue"]
    assert (found.value, found.low, found.high) == pytest.approx((1.2, 0.6, 1.5))


def test_a_sum_of_two_delays_adds_their_errors_in_quadrature() -> None:
    q = quantities(
        [
            _value("pump_lag", "dead_s", 0.3, (0.27, 0.33)),
            _value("pump_lag", "spinup_s", 0.5, (0.46, 0.54)),
        ]
    )["pump_lag"]
    assert (q.value, q.low, q.high) == pytest.approx((0.8, 0.75, 0.85))


def test_every_comparable_quantity_is_of_a_parameter_that_the_library_has() -> None:
    library = {e.name: {p.name for p in e.parameters} for e in SmaPlant().effects}
    for effect in COMPARABLE:
        values = [_value(effect, name, 1.0, (0.5, 1.5)) for name in library[effect]]
        assert effect in quantities(values)
