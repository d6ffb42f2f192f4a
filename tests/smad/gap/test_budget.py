"""The budget: where the gap goes, always told; and a model that holds what the verdict names."""

from __future__ import annotations

from dataclasses import replace

import pytest
from smad.gap import diagnose
from smad.gap.compare.tracks import follow_tracks
from smad.gap.diagnose import ready
from smad.gap.records import Budget, BudgetRow, Diagnosis, Outcome
from smad.gap.report import summary_lines
from smad.gap.report.advice import Asked
from smad.gap.report.budget import budget_of, way
from smad.gap.report.plain import plain

from smad.diagnosis.plant import Effect
from tests.smad.gap.cases import FAR_OFF, OTHER, SETTINGS, SHOWN, ask, bank, without
from tests.smad.gap.heater_plant import EFFECTS, HeaterPlant, recorded

COUPLED = {"coupling": SHOWN["coupling"]}


@pytest.fixture(scope="module")
def coupled() -> Diagnosis:
    return ask(bank(OTHER, COUPLED))


def budget(d: Diagnosis) -> Budget:
    assert d.budget is not None
    return d.budget


def test_the_shares_of_every_signal_add_up_to_the_raw_gap(coupled: Diagnosis) -> None:
    for row in budget(coupled).rows:
        if row.raw > 0.0:
            assert row.parameters + sum(row.causes) + row.rest == pytest.approx(1.0)
            assert row.left == pytest.approx(row.rest * row.raw)
    assert budget(coupled).rows[0].signal == ""
    assert len(budget(coupled).rows) > 3


def test_parameters_that_the_cause_makes_needless_take_nothing_and_are_not_in_the_model() -> None:
    d = ask(bank(None, COUPLED))
    assert d.verdict.effects == ["coupling"]
    assert not budget(d).parameters
    assert budget(d).rows[0].parameters == 0.0
    assert d.model["theta"] == {p.name: p.nominal for p in HeaterPlant().parameters}
    assert list(d.model["effects"]) == ["coupling"]
    assert "model to apply: coupling and the parameters as they were" in d.verdict.text


def test_parameters_that_are_needed_beside_the_cause_are_told_and_kept(coupled: Diagnosis) -> None:
    assert budget(coupled).parameters
    assert coupled.model["theta"]["c_J_K"] == pytest.approx(OTHER["c_J_K"], rel=0.02)
    assert "model to apply: coupling and the refitted parameters" in coupled.verdict.text


def test_a_quiet_bench_gets_a_model_with_nothing_in_it() -> None:
    d = ask(bank()[:2])
    assert d.verdict.outcome is Outcome.NO_GAP
    assert d.model["effects"] == {}
    assert d.model["theta"] == {p.name: p.nominal for p in HeaterPlant().parameters}
    assert d.verdict.plain == "Model and bench agree within the noise."


def test_an_unknown_cause_has_a_budget_whose_rest_is_told() -> None:
    d = ask(bank(OTHER, {"sensor_lag": SHOWN["sensor_lag"]})[::2], without("sensor_lag"))
    assert d.verdict.outcome is Outcome.UNKNOWN
    assert not budget(d).named
    assert budget(d).rows[0].rest > 0.3
    assert f"{budget(d).rows[0].rest:.0%}".replace("%", " % is left.") in d.verdict.plain


def test_a_cause_whose_strength_ends_at_its_bound_is_not_found() -> None:
    weak = tuple(_weaker(e) if e.name == "coupling" else e for e in EFFECTS)
    d = diagnose(bank(OTHER, COUPLED), plant=HeaterPlant(weak), settings=SETTINGS)
    assert d.verdict.outcome is Outcome.UNKNOWN
    assert d.verdict.bounded == ["coupling"]
    assert d.verdict.plain.startswith("No cause found")
    assert d.model["effects"] == {}


def test_a_further_cause_that_ends_at_its_bound_puts_no_doubt_in_the_first() -> None:
    weak = tuple(_weaker(e) if e.name == "coupling" else e for e in EFFECTS)
    both = {"sensor_lag": {"tau_s": 2.5}, **COUPLED}
    d = diagnose(bank(OTHER, both), plant=HeaterPlant(weak), settings=SETTINGS)
    assert d.verdict.effects == ["sensor_lag"]
    assert d.verdict.bounded == []


def _weaker(effect: Effect) -> Effect:
    """The effect with a range that ends at half of what the bench has."""
    half = SHOWN["coupling"]["g_W_K"] / 2
    return replace(
        effect, parameters=tuple(replace(q, high=half, typical=half / 2) for q in effect.parameters)
    )


def test_the_run_that_carries_most_of_the_gap_is_named_beside_the_median() -> None:
    runs = [recorded("random", seed, OTHER, duration_s=30.0) for seed in (1, 2, 3)]
    odd = replace(recorded("random", 4, FAR_OFF, duration_s=30.0), name="odd one")
    d = ask([*runs, odd])
    assert budget(d).dominated_by == "odd one"
    assert budget(d).median is not None
    assert any("odd one carries" in line for line in summary_lines(d))


def test_the_answer_comes_first_then_what_to_do_then_the_numbers(coupled: Diagnosis) -> None:
    headline, answer, *rest = summary_lines(coupled, Asked())
    assert headline == "Cause found"
    assert answer == coupled.verdict.plain
    assert rest.index("Next:") < rest.index(coupled.verdict.text.splitlines()[0])
    assert any(line.startswith("  smad gap verify --model better.toml") for line in rest)


def test_where_no_command_asked_none_is_shown(coupled: Diagnosis) -> None:
    lines = summary_lines(coupled)
    assert "  # try it on runs that are new to it" in lines
    assert not any(line.startswith("  smad gap") for line in lines)


def test_parameters_that_make_other_runs_worse_are_said_to_add_to_the_gap() -> None:
    def told(*, named: bool) -> str:
        row = BudgetRow("", 1.0, "", 100.0, -0.2, [1.18], 0.02, 2.0)
        made = Budget(["coupling"], named, True, 0.0, [row], [], None, "", 0.0)
        return plain(
            Outcome.EFFECT if named else Outcome.UNKNOWN,
            titles={"coupling": "heat flow"}, effects=["coupling"] if named else [], group=[],
            values=[], budget=made,
        )  # fmt: skip

    assert "of which other values of the parameters add 20 %; 2 % is left." in told(named=True)
    assert "fitted to some runs, add 20 % to the gap of others" in told(named=False)
    assert "118 % of it goes with the best entry of the library (heat flow)" in told(named=False)


def test_causes_that_entered_together_have_a_share_each() -> None:
    both = {"sensor_lag": {"tau_s": 2.5}, **COUPLED}
    prepared = ready(bank(OTHER, both), plant=HeaterPlant(), settings=SETTINGS)
    selection = follow_tracks(prepared, EFFECTS).selection
    assert sorted(selection.best.names) == ["coupling", "sensor_lag"]
    refit = selection.base.judged
    took = way(prepared, [selection.best], refit)
    told = budget_of(prepared, took, refit, named=True)
    assert took.parameters
    assert sorted(told.causes) == ["coupling", "sensor_lag"]
    for row in told.rows:
        assert len(row.causes) == 2
        if row.raw > 0.0:
            assert row.parameters + sum(row.causes) + row.rest == pytest.approx(1.0)
