"""Each clause of the oracle, on an outcome that is right and on ones doctored to be wrong."""

from dataclasses import replace

import pytest

from campaign.faults.oracle import (
    CLAUSES,
    Ending,
    Expectation,
    LogFound,
    Outcome,
    Then,
    judge,
)

STOPPED = Outcome(
    name="leak",
    group="actuator",
    scene="heating",
    injected="leak@3.00:",
    expected=Expectation(Then.STOPS, ("LEAK",), 3.0, host_is_told=True),
    first_fault="LEAK",
    told_fault="LEAK",
    safe_after_s=0.06,
    energy_J=0.7,
    energy_after_safe_J=0.0,
    hottest_degC=60.0,
    states=((0.0, "ARMED"), (0.06, "FAULT")),
    gate_open_later=False,
    host_running_later=False,
    log=LogFound(rows=300, flushed=200),
    ending=Ending(0, "smad: ended by SIGTERM: disarmed", 0, ("ended by SIGTERM",)),
)
WENT_ON = replace(
    STOPPED,
    expected=Expectation(Then.GOES_ON, (), 60.0),
    first_fault="",
    told_fault="",
    safe_after_s=None,
    energy_J=40.0,
    states=((0.0, "ARMED"), (0.1, "HOLD"), (0.5, "ARMED")),
)
ENDED = STOPPED.ending
assert ENDED is not None

DOCTORED = [
    ("energy", replace(STOPPED, energy_J=3.1), "budget"),
    ("energy", replace(STOPPED, energy_J=float("nan")), "budget"),
    ("energy", replace(STOPPED, energy_after_safe_J=0.5), "after the gate was off"),
    ("energy", replace(WENT_ON, energy_J=61.0), "budget"),
    ("wire", replace(STOPPED, hottest_degC=151.0), "151 °C; it stands 150"),
    ("wire", replace(WENT_ON, hottest_degC=float("nan")), "it stands"),
    ("cause", replace(STOPPED, first_fault="BROWN_OUT"), "not LEAK"),
    ("cause", replace(STOPPED, first_fault=""), "without naming"),
    ("cause", replace(STOPPED, told_fault="WIRE_OPEN"), "was told WIRE_OPEN"),
    ("cause", replace(STOPPED, told_fault=""), "was told nothing"),
    ("cause", replace(STOPPED, safe_after_s=None), "did not stop"),
    ("cause", replace(WENT_ON, safe_after_s=0.2), "harmless"),
    ("cause", replace(WENT_ON, first_fault="LEAK"), "there should be none"),
    (
        "cause",
        replace(STOPPED, expected=replace(STOPPED.expected, then=Then.RESTARTS)),
        "there should be none",
    ),
    (
        "rearm",
        replace(STOPPED, states=(*STOPPED.states, (1.0, "SAFE"), (1.5, "ARMED"))),
        "ARMED again 1.50 s",
    ),
    (
        "rearm",
        replace(WENT_ON, states=((0.0, "ARMED"), (0.1, "HOLD"), (0.9, "ARMED"))),
        "out of HOLD after 0.80 s",
    ),
    ("rearm", replace(STOPPED, gate_open_later=True), "gate"),
    ("rearm", replace(STOPPED, host_running_later=True), "host"),
    ("log", replace(STOPPED, log=LogFound(199, 200)), "199 samples of 200"),
    ("log", replace(STOPPED, log=LogFound(0, 200, "is not a run log")), "cannot be read"),
    ("ending", replace(STOPPED, ending=replace(ENDED, status=70)), "status 70, not 0"),
    ("ending", replace(STOPPED, ending=replace(ENDED, line="smad: bye")), "'smad: bye'"),
    ("refusal", replace(STOPPED, not_refused="a stranger armed"), "a stranger armed"),
]


@pytest.mark.parametrize("outcome", [STOPPED, WENT_ON], ids=["stopped", "went on"])
def test_an_outcome_that_is_right_passes(outcome: Outcome) -> None:
    assert judge(outcome) == []


@pytest.mark.parametrize(("clause", "outcome", "says"), DOCTORED)
def test_a_doctored_outcome_fails_the_clause_it_breaks_and_no_other(
    clause: str, outcome: Outcome, says: str
) -> None:
    (violation,) = judge(outcome)
    assert violation.clause == clause
    assert says in violation.reason


def test_every_clause_is_seen_to_fail_above() -> None:
    assert {clause for clause, _, _ in DOCTORED} == set(CLAUSES)
