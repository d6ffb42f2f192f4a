"""How the constants of the decision are chosen from the answers of a development bank."""

from __future__ import annotations

import tomllib

import pytest
from smad.gap.records import Outcome
from smad.gap.settings import Settings

from evaluation.calibrate.decision import (
    CONSTANTS,
    GRID,
    Answer,
    Found,
    as_toml,
    chosen_constants,
    reliability,
    shares_right,
    worth,
)
from smad.diagnosis.bank.key import CaseKey, TrueEffect

LAG = CaseKey("single", [TrueEffect("rtd_lag", "sensors")])
PAIR = CaseKey("pair", [TrueEffect("rtd_lag", "sensors"), TrueEffect("force_offset", "sensors")])
DIFFERS = CaseKey("differs", [TrueEffect("rtd_lag", "sensors")])
NONE, FOREIGN = CaseKey("none"), CaseKey("unknown", [TrueEffect("coil_contact", "mechanics")])
QUIET, UNKNOWN = Answer(Outcome.NO_GAP), Answer(Outcome.UNKNOWN)


def named(*names: str, group: tuple[str, ...] = ()) -> Answer:
    return Answer(Outcome.AMBIGUOUS if group else Outcome.EFFECT, names, group)


@pytest.mark.parametrize(
    ("true", "said", "value"),
    [
        (LAG, named("rtd_lag"), 1.0),
        (LAG, named("rtd_lag", "viscous_drag"), 0.5),
        (LAG, named("channel_delay", group=("rtd_lag",)), 0.5),
        (LAG, named("viscous_drag"), -2.0),
        (LAG, QUIET, 0.0),
        (LAG, UNKNOWN, 0.0),
        (PAIR, named("force_offset"), 1.0),
        (DIFFERS, named("cooling_front", "rtd_lag"), 1.0),
        (DIFFERS, named("cooling_front"), 0.0),
        (NONE, QUIET, 1.0),
        (NONE, UNKNOWN, -1.0),
        (NONE, named("rtd_lag"), -2.0),
        (FOREIGN, UNKNOWN, 1.0),
        (FOREIGN, QUIET, 0.0),
        (FOREIGN, named("rtd_lag"), -2.0),
    ],
)
def test_a_wrong_name_costs_twice_what_a_right_answer_is_worth(
    true: CaseKey, said: Answer, value: float
) -> None:
    assert worth(true, said) == value


def bank(said_with_less: Answer) -> Found:
    """Four lags of which three are seen with a lower `since_gain` only, and two quiet benches."""
    lower = f"since_gain={GRID['since_gain'][0]:g}"
    lags = {f"lag-{i}": {"": QUIET, lower: named("rtd_lag")} for i in range(3)}
    others = {
        "lag-3": {"": named("rtd_lag")},
        "quiet-0": {"": QUIET, lower: said_with_less},
        "quiet-1": {"": QUIET},
    }
    true = {name: LAG if name.startswith("lag") else NONE for name in (*lags, *others)}
    return Found(true, {**lags, **others})


def test_a_value_is_chosen_where_cases_left_out_gain_by_it_too() -> None:
    now = {name: getattr(Settings(), name) for name in GRID}
    assert chosen_constants(bank(QUIET)) == now | {"since_gain": GRID["since_gain"][0]}
    alarms = bank(named("viscous_drag"))
    assert alarms.total("since_gain", GRID["since_gain"][0], list(alarms.said)) == 3.0
    # Each of three cases is as good a reason as the others are: what one alone asks for is luck.
    one = Found(
        {c: alarms.true[c] for c in ("lag-0", "quiet-1")},
        {c: alarms.said[c] for c in ("lag-0", "quiet-1")},
    )
    assert chosen_constants(one) == now


def test_without_a_reason_a_constant_stays_as_it_is() -> None:
    found = bank(QUIET)
    assert found.best("odds", 10.0, list(found.said)) == 10.0


def test_shares_are_what_was_right_of_what_the_evidence_said() -> None:
    found = bank(QUIET)
    shares = shares_right(found)
    # Two quiet benches of five quiet answers, one right name of one.
    assert shares == {"quiet": round(3 / 7, 2), "named": round(2 / 3, 2), "unsure": 0.5}
    said = reliability(found, shares)
    assert said.splitlines()[1].split()[:3] == ["quiet", "5", "0.40"]


def test_the_file_in_the_package_is_as_the_command_writes_it() -> None:
    shipped = tomllib.loads(CONSTANTS.read_text())
    assert list(shipped["decision"]) == list(GRID)
    assert len(GRID) <= 8
    source = CONSTANTS.read_text().partition(" from ")[2].partition(".\n")[0]
    assert as_toml(shipped["decision"], shipped["right"], source) == CONSTANTS.read_text()
