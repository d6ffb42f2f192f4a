"""The board's machine: every trigger in every state, arming, HOLD, COOL, FAULT, ESTOP."""

import itertools

import pytest

from firmware_protocol.enums import BoardState, Channel, ErrorCode, Fault, Limiter
from firmware_protocol.supervisor import (
    TRANSITIONS,
    ArmConfirmed,
    ArmRequested,
    Disarmed,
    FaultCleared,
    Link,
    Measurements,
    SelfTest,
    SetpointArrived,
    Stopped,
    Supervisor,
    Trigger,
)
from firmware_protocol.supervisor.flat import TRANSITION, TRIGGER_COUNT
from firmware_protocol.supervisor.machine import fire
from firmware_protocol.supervisor.states import (
    CURRENT_ALLOWED,
    STATE_MEANING,
    STATE_OUTPUTS,
    TRIGGER_MEANING,
)

from .bench import GOOD_LINK, Rig


@pytest.mark.parametrize(("state", "trigger"), list(itertools.product(BoardState, Trigger)))
def test_a_trigger_moves_the_board_as_the_table_says_and_else_not(
    state: BoardState, trigger: Trigger
) -> None:
    memory = Supervisor().memory
    memory.state = state
    moved = fire(memory, trigger)
    expected = TRANSITIONS[state].get(trigger)
    assert moved == (expected is not None)
    assert memory.state == (state if expected is None else expected)


def test_the_flat_table_holds_every_arrow_once() -> None:
    arrows = sum(len(row) for row in TRANSITIONS.values())
    assert len(TRANSITION) == len(BoardState) * TRIGGER_COUNT
    assert sum(following >= 0 for following in TRANSITION) == arrows


def test_every_state_and_trigger_is_described_and_has_outputs() -> None:
    assert set(STATE_MEANING) == set(STATE_OUTPUTS) == set(TRANSITIONS) == set(BoardState)
    assert set(TRIGGER_MEANING) == set(Trigger)


def test_only_arming_leads_to_a_state_that_may_heat() -> None:
    ways = {
        (state, trigger)
        for state, arrows in TRANSITIONS.items()
        for trigger, following in arrows.items()
        if following in CURRENT_ALLOWED
    }
    assert ways == {
        (BoardState.SAFE, Trigger.ARM_CONFIRMED),
        (BoardState.HOLD, Trigger.SETPOINT_FRESH),
    }


def test_nothing_leaves_estop() -> None:
    assert TRANSITIONS[BoardState.ESTOP] == {}


def test_every_state_but_estop_can_be_stopped() -> None:
    assert all(Trigger.ESTOP in TRANSITIONS[s] for s in BoardState if s is not BoardState.ESTOP)


def test_a_board_that_passes_its_self_test_is_safe_with_everything_off() -> None:
    rig = Rig()
    assert rig.state is BoardState.BOOT
    rig.event(SelfTest(True))
    rig.step()
    assert rig.state is BoardState.SAFE
    assert not rig.memory.gate
    assert rig.memory.duty == [0, 0]
    assert rig.memory.warnings == 0


def test_a_board_that_fails_its_self_test_is_in_fault() -> None:
    rig = Rig()
    rig.event(SelfTest(False))
    assert rig.state is BoardState.FAULT
    assert rig.supervisor.first_fault is not None
    assert rig.supervisor.first_fault.fault is Fault.SELF_TEST


def test_an_armed_board_lets_the_setpoint_out() -> None:
    rig = Rig().arm()
    rig.setpoint_mA, rig.duty = (1500, 0), (0, 200)
    rig.step(2)
    assert rig.state is BoardState.ARMED
    assert rig.memory.gate
    assert rig.memory.applied_mA == [1500, 0]
    assert rig.memory.duty == [0, 200]


# Arming


def ready() -> Rig:
    rig = Rig()
    rig.event(SelfTest(True))
    rig.step()
    return rig


def refused(rig: Rig, code: ErrorCode) -> str:
    """Both steps refuse with `code`; return the message of the first."""
    request = rig.event(ArmRequested(GOOD_LINK, 5))
    confirm = rig.event(ArmConfirmed(GOOD_LINK, 5))
    assert (request.code, confirm.code) == (code, code)
    assert rig.state is not BoardState.ARMED
    return request.message


def test_a_confirmation_without_a_request_does_not_arm() -> None:
    outcome = ready().event(ArmConfirmed(GOOD_LINK, 0))
    assert outcome.code is ErrorCode.TOKEN_WRONG


def test_a_token_works_once() -> None:
    rig = Rig().arm()
    rig.event(Disarmed())
    rig.until(BoardState.SAFE)
    assert rig.event(ArmConfirmed(GOOD_LINK, 77)).code is ErrorCode.TOKEN_WRONG


def test_a_wrong_token_does_not_arm_and_spoils_the_right_one() -> None:
    rig = ready()
    rig.event(ArmRequested(GOOD_LINK, 5))
    outcome = rig.event(ArmConfirmed(GOOD_LINK, 6))
    assert outcome.code is ErrorCode.TOKEN_WRONG
    assert "6" in outcome.message
    assert rig.event(ArmConfirmed(GOOD_LINK, 5)).code is ErrorCode.TOKEN_WRONG


def test_a_request_that_is_refused_withdraws_the_token_before_it() -> None:
    rig = ready()
    rig.event(ArmRequested(GOOD_LINK, 5))
    assert not rig.event(ArmRequested(Link(clock=False), 6)).accepted
    assert rig.event(ArmConfirmed(GOOD_LINK, 5)).code is ErrorCode.TOKEN_WRONG


@pytest.mark.parametrize(("wait_us", "accepted"), [(2_000_000, True), (2_000_001, False)])
def test_a_token_is_valid_for_two_seconds(wait_us: int, accepted: bool) -> None:
    rig = ready()
    rig.event(ArmRequested(GOOD_LINK, 5))
    rig.now_us += wait_us
    outcome = rig.event(ArmConfirmed(GOOD_LINK, 5))
    assert outcome.accepted == accepted
    if not accepted:
        assert outcome.code is ErrorCode.TOKEN_EXPIRED
        assert (outcome.value, outcome.limit) == (wait_us, 2_000_000)


@pytest.mark.parametrize(
    ("link", "code"),
    [
        (Link(session=False), ErrorCode.NO_SESSION),
        (Link(schema=False), ErrorCode.SCHEMA_DIFFERS),
        (Link(parameters=False), ErrorCode.PARAMETERS_DIFFER),
        (Link(clock=False), ErrorCode.CLOCK_UNLOCKED),
    ],
)
def test_arming_needs_an_agreed_link_at_both_steps(link: Link, code: ErrorCode) -> None:
    rig = ready()
    assert rig.event(ArmRequested(link, 5)).code is code
    assert rig.event(ArmRequested(GOOD_LINK, 5)).accepted
    assert rig.event(ArmConfirmed(link, 5)).code is code
    assert rig.state is BoardState.SAFE


@pytest.mark.parametrize("channel", range(4))
@pytest.mark.parametrize("reading", [-32768, 32767, -24200])
def test_arming_needs_every_sensor(channel: int, reading: int) -> None:
    rig = ready()

    def spoil(m: Measurements) -> None:
        m.rtd_cC[channel] = reading

    rig.spoil = spoil
    rig.step()
    message = refused(rig, ErrorCode.SENSOR_INVALID)
    assert Channel(channel).name in message
    assert str(reading) in message


def test_arming_needs_cold_springs_and_says_how_cold() -> None:
    rig = ready()
    rig.m.rtd_cC[1] = 4500
    rig.physical = False
    rig.step()
    assert "SPRING_Y is at 4500 cC, must be below 4500 cC" in refused(rig, ErrorCode.TOO_HOT)


def test_arming_needs_no_current() -> None:
    rig = ready()
    rig.physical = False
    rig.m.i_mA[0] = 600
    rig.step(1, 9_000)
    rig.step(1, 9_000)
    assert "SPRING_X carries" in refused(rig, ErrorCode.CURRENT_FLOWING)


def test_arming_needs_the_supply() -> None:
    rig = ready()
    rig.m.vbus_mV = 7000
    rig.step()
    assert "7000 mV, must be above 7500 mV" in refused(rig, ErrorCode.SUPPLY_LOW)


@pytest.mark.parametrize(
    ("field", "name"), [("encoder_invalid", "ENCODER"), ("force_invalid", "FORCE")]
)
def test_arming_needs_encoder_and_load_cell(field: str, name: str) -> None:
    rig = ready()
    setattr(rig.m, field, 1)
    rig.step()
    assert name in refused(rig, ErrorCode.SENSOR_INVALID)


def test_arming_is_refused_while_a_fault_stands_and_names_it() -> None:
    rig = ready()
    rig.m.leak = 1
    rig.seconds(0.2)
    assert "LEAK" in refused(rig, ErrorCode.FAULT_PRESENT)


@pytest.mark.parametrize("state", [BoardState.ARMED, BoardState.COOL, BoardState.ESTOP])
def test_arming_is_refused_outside_safe(state: BoardState) -> None:
    rig = Rig().heat(seconds=4.0)
    if state is BoardState.COOL:
        rig.event(Disarmed())
    elif state is BoardState.ESTOP:
        rig.event(Stopped())
    message = rig.event(ArmRequested(GOOD_LINK, 5)).message
    assert f"the board is in {state.name}, it must be in SAFE" in message


# Setpoints and HOLD


def test_setpoints_in_safe_do_nothing() -> None:
    rig = ready()
    refused_one = rig.event(SetpointArrived((3000, 0), (0, 0), 0, 100_000))
    assert refused_one.code is ErrorCode.WRONG_STATE
    rig.setpoint_mA = (4000, 4000)
    rig.step(5)
    assert rig.memory.applied_mA == [0, 0]
    assert rig.state is BoardState.SAFE


def test_an_armed_board_starts_afresh_whatever_came_before() -> None:
    rig = Rig()
    rig.duty = (0, 90)
    rig.heat(2000)
    assert rig.memory.reference_mohm[0]
    rig.m.vbus_mV = 7000
    rig.step()
    rig.event(Disarmed())
    rig.m.vbus_mV = 12_000
    rig.until(BoardState.SAFE)
    rig.send = False
    rig.event(ArmRequested(GOOD_LINK, 9))
    rig.event(ArmConfirmed(GOOD_LINK, 9))
    assert (rig.memory.reference_mohm, rig.memory.anchor_net_nJ) == ([0, 0], [0, 0])
    rig.m.vbus_mV = 7000
    rig.step()
    assert rig.state is BoardState.ARMED, "one dip of the supply is no fault"
    assert (rig.memory.applied_mA, rig.memory.duty) == ([0, 0], [0, 0])


def test_estop_opens_the_gate_before_the_next_sample() -> None:
    rig = Rig().heat()
    assert rig.memory.gate
    rig.event(Stopped())
    assert (rig.memory.gate, rig.memory.applied_mA) == (0, [0, 0])


@pytest.mark.parametrize("stage_um", [-1, 200_001])
def test_a_setpoint_that_cannot_be_is_refused_whole(stage_um: int) -> None:
    rig = Rig().arm()
    outcome = rig.event(SetpointArrived((3000, 0), (0, 0), 0, 100_000, stage_um))
    assert outcome.code is ErrorCode.OUT_OF_RANGE
    assert rig.memory.applied_mA == [0, 0]


@pytest.mark.parametrize("age_us", [-1, 50_001, 10**9])
def test_a_stale_setpoint_is_refused_counted_and_shown(age_us: int) -> None:
    rig = Rig().arm()
    outcome = rig.event(SetpointArrived((3000, 0), (0, 0), age_us, 100_000))
    assert outcome.code is ErrorCode.SETPOINT_STALE
    assert (outcome.value, outcome.limit) == (age_us, 50_000)
    assert rig.memory.stale_setpoints == 1
    rig.step()
    assert rig.memory.applied_mA == [0, 0]
    assert rig.memory.warnings & 1


def test_silence_leads_to_hold_then_to_fault_with_the_current_off_at_once() -> None:
    rig = Rig().heat()
    rig.send = False
    assert rig.until(BoardState.HOLD) == pytest.approx(0.11, abs=0.011)
    assert rig.memory.applied_mA == [0, 0]
    assert rig.until(BoardState.FAULT) == pytest.approx(0.51, abs=0.011)
    fault = rig.supervisor.first_fault
    assert fault is not None
    assert fault.fault is Fault.SETPOINT_LOST
    assert fault.measured > fault.limit == 600_000
    assert fault.t_us == rig.now_us
    assert not rig.memory.gate


def test_a_fresh_setpoint_within_half_a_second_ends_hold() -> None:
    rig = Rig().heat()
    rig.send = False
    rig.until(BoardState.HOLD)
    rig.seconds(0.4)
    rig.send = True
    rig.step(2)
    assert rig.state is BoardState.ARMED
    assert rig.memory.applied_mA == [4000, 0]


def test_a_short_ttl_is_kept_and_a_long_one_is_cut() -> None:
    rig = Rig().arm()
    rig.send = False
    rig.event(SetpointArrived((500, 0), (0, 0), 0, 30_000))
    assert rig.until(BoardState.HOLD) == pytest.approx(0.04, abs=0.011)
    rig.event(SetpointArrived((500, 0), (0, 0), 0, 60_000_000))
    assert rig.state is BoardState.ARMED
    assert rig.until(BoardState.HOLD) == pytest.approx(0.11, abs=0.011)


def test_a_setpoint_counts_at_once_but_rises_no_faster_than_the_slew_limit() -> None:
    rig = Rig().arm()
    rig.send = False
    rig.step(1, 2000)
    rig.event(SetpointArrived((4000, 0), (0, 0), 0, 100_000))
    seen = [rig.memory.applied_mA[0]]
    limiters = [rig.supervisor.limiter]
    for _ in range(5):
        rig.step(1, 2000)
        seen.append(rig.memory.applied_mA[0])
        limiters.append(rig.supervisor.limiter)
    assert seen == [800, 1600, 2400, 3200, 4000, 4000]
    assert limiters[:4] == [Limiter.SLEW] * 4
    assert limiters[-1] is Limiter.NONE


def test_current_falls_at_once() -> None:
    rig = Rig().heat()
    rig.event(SetpointArrived((0, 0), (0, 0), 0, 100_000))
    assert rig.memory.applied_mA == [0, 0]


def test_a_setpoint_above_the_maximum_is_cut_and_the_limiter_says_so() -> None:
    rig = Rig().arm()
    rig.setpoint_mA = (9000, 0)
    rig.step(3)
    assert rig.memory.applied_mA == [4000, 0]
    assert rig.supervisor.limiter is Limiter.MAXIMUM


# COOL, FAULT, ESTOP


SPRINGS = pytest.mark.parametrize("k", [0, 1], ids=["X", "Y"])


@SPRINGS
def test_disarming_cools_with_the_pumps_on_until_cold(k: int) -> None:
    rig = heated(k)
    assert rig.m.rtd_cC[k] > 5000
    assert rig.event(Disarmed()).accepted
    assert rig.state is BoardState.COOL
    assert not rig.memory.gate
    assert rig.memory.duty == [255, 255]
    assert rig.until(BoardState.SAFE) < 30.0
    assert 4400 < rig.m.rtd_cC[k] < 4500
    assert rig.memory.duty == [0, 0]


def test_cooling_is_capped_and_a_warning_says_it_is_still_hot() -> None:
    rig = Rig().heat(seconds=8.0)
    rig.event(Disarmed())
    rig.step()
    rig.physical = False
    rig.m.rtd_cC[0] = 5000
    rig.supervisor.limits.cooling_excess_cC = 10_000
    for _ in range(59):
        rig.m.rtd_cC[0] ^= 1
        rig.seconds(1.0)
    assert rig.state is BoardState.COOL
    rig.seconds(2.0)
    assert rig.state is BoardState.SAFE
    assert rig.memory.warnings >> 6 & 1
    assert rig.event(ArmRequested(GOOD_LINK, 5)).code is ErrorCode.TOO_HOT


@pytest.mark.parametrize("state", [BoardState.SAFE, BoardState.FAULT])
def test_disarming_where_nothing_heats_is_accepted_and_changes_nothing(state: BoardState) -> None:
    rig = ready()
    if state is BoardState.FAULT:
        rig.m.leak = 1
        rig.seconds(0.2)
    assert rig.event(Disarmed()).accepted
    assert rig.state is state


def test_disarming_takes_a_granted_token_back() -> None:
    rig = ready()
    rig.event(ArmRequested(GOOD_LINK, 5))
    rig.event(Disarmed())
    assert rig.event(ArmConfirmed(GOOD_LINK, 5)).code is ErrorCode.TOKEN_WRONG


def heated(k: int) -> Rig:
    """A rig with one hot spring."""
    return Rig().heat(4000 * (1 - k), 4000 * k, seconds=8.0)


def faulted(k: int = 0) -> Rig:
    """A rig in FAULT with an open sensor, on a spring that is hot."""
    rig = heated(k)

    def spoil(m: Measurements) -> None:
        m.rtd_cC[k] = 32767

    rig.spoil = spoil
    rig.until(BoardState.FAULT)
    rig.step()
    return rig


def mend(rig: Rig) -> None:
    rig.spoil = lambda m: None


def test_a_fault_cuts_the_gate_keeps_measuring_and_runs_the_pumps() -> None:
    rig = faulted()
    assert not rig.memory.gate
    assert rig.memory.applied_mA == [0, 0]
    assert rig.memory.duty == [255, 255]
    mend(rig)
    before = rig.memory.now_us
    rig.seconds(30.0)
    assert rig.memory.now_us == before + 30_000_000
    assert rig.memory.duty == [0, 0], "cold again, the pumps rest"


def test_a_leak_stops_the_pumps_that_an_earlier_fault_runs() -> None:
    rig = faulted()
    assert rig.memory.duty == [255, 255]
    rig.m.leak = 1
    rig.seconds(0.1)
    assert rig.memory.first_fault == Fault.SENSOR_OPEN
    assert rig.memory.duty == [0, 0]
    rig.m.leak = 0
    rig.seconds(1.0)
    assert rig.memory.duty == [0, 0], "what has leaked once is not filled again"


def test_in_fault_the_pumps_run_while_current_flows_however_cold_and_however_long() -> None:
    rig = ready()

    def welded(m: Measurements) -> None:
        m.i_mA[1] = 3000

    rig.spoil = welded
    rig.until(BoardState.FAULT)
    assert rig.memory.first_fault == Fault.UNCOMMANDED_CURRENT
    for _ in range(70):
        rig.seconds(1.0)
        assert rig.memory.duty == [255, 255]
    mend(rig)
    rig.seconds(1.0)
    assert rig.memory.duty == [0, 0]


@SPRINGS
def test_a_fault_is_cleared_by_name_when_its_cause_is_gone_and_all_is_cold(k: int) -> None:
    rig = faulted(k)
    assert rig.event(FaultCleared(Fault.LEAK)).code is ErrorCode.WRONG_FAULT
    remains = rig.event(FaultCleared(Fault.SENSOR_OPEN))
    assert remains.code is ErrorCode.CAUSE_REMAINS
    assert f"SENSOR_OPEN on {Channel(k).name}" in remains.message
    mend(rig)
    rig.step()
    hot = rig.event(FaultCleared(Fault.SENSOR_OPEN))
    assert hot.code is ErrorCode.TOO_HOT
    assert hot.value > hot.limit == 4500
    rig.seconds(30.0)
    assert rig.event(FaultCleared(Fault.SENSOR_OPEN)).accepted
    assert rig.state is BoardState.SAFE
    assert rig.memory.faults == 0


def test_a_cleared_fault_stays_readable_and_does_not_arm_by_itself() -> None:
    rig = faulted()
    mend(rig)
    rig.seconds(30.0)
    rig.event(FaultCleared(Fault.SENSOR_OPEN))
    rig.setpoint_mA = (4000, 0)
    rig.seconds(2.0)
    assert rig.state is BoardState.SAFE
    assert rig.memory.applied_mA == [0, 0]
    assert rig.supervisor.first_fault is not None
    assert rig.supervisor.first_fault.fault is Fault.SENSOR_OPEN


def test_there_is_nothing_to_clear_outside_fault() -> None:
    assert ready().event(FaultCleared(Fault.LEAK)).code is ErrorCode.WRONG_STATE


def test_what_follows_a_fault_is_added_and_does_not_replace_the_first() -> None:
    rig = faulted()
    rig.m.leak = 1
    rig.seconds(0.2)
    fault = rig.supervisor.first_fault
    assert fault is not None
    assert (fault.fault, fault.channel) == (Fault.SENSOR_OPEN, Channel.SPRING_X)
    assert (fault.measured, fault.limit) == (32767, 20000)
    assert str(fault) == "SENSOR_OPEN on SPRING_X: 32767 cC, limit 20000 cC"
    bits = 1 << (Fault.SENSOR_OPEN - 1) | 1 << (Fault.LEAK - 1)
    assert rig.memory.faults == bits


@pytest.mark.parametrize("state", list(BoardState))
def test_estop_switches_all_off_from_any_state_until_the_power_is_cycled(state: BoardState) -> None:
    rig = Rig()
    if state is not BoardState.BOOT:
        rig.heat()
        rig.memory.state = state
    rig.event(Stopped())
    assert rig.state is BoardState.ESTOP
    for event in (Disarmed(), ArmRequested(GOOD_LINK, 1), FaultCleared(Fault.ESTOP_PRESSED)):
        rig.event(event)
    rig.setpoint_mA = (4000, 0)
    rig.step(20)
    assert rig.state is BoardState.ESTOP
    assert not rig.memory.gate
    assert rig.memory.applied_mA == [0, 0]
    assert rig.memory.duty == [0, 0]


def test_estop_is_told_as_a_fault_unless_one_came_first() -> None:
    rig = Rig().arm()
    rig.event(Stopped())
    assert rig.supervisor.first_fault is not None
    assert rig.supervisor.first_fault.fault is Fault.ESTOP_PRESSED
    rig = faulted()
    rig.event(Stopped())
    assert rig.supervisor.first_fault is not None
    assert rig.supervisor.first_fault.fault is Fault.SENSOR_OPEN
