"""The states of the board, what moves it between them, and what each state lets out.

Three rules hold everywhere in this package.

1. The board alone decides whether a heater may be on. The host asks; the board answers yes, or
   no with a reason. Nothing the host sends, and nothing it fails to send, can keep a gate open.
2. "Off" is the gate, not a setpoint of zero. Wherever the table below says the gate is off, the
   current is cut in front of the driver, so that a driver that failed short is cut as well.
3. Every way out of a state that heats is automatic; every way into one needs a person. HOLD is
   the one exception: a link that stalls for less than half a second may go on where it was.

Theory of operation. The board wakes in BOOT and tests itself. In SAFE it measures and reports.
Arming takes two steps, so that one stray or repeated frame cannot arm: a request, answered by a
token, then a confirmation that carries the token back within two seconds. Both steps check every
precondition. In ARMED the current follows the setpoints below the ceilings the checks set. When
setpoints stop, HOLD takes the current away and waits a moment; then it is a fault. An orderly end
goes through COOL, with the pumps on, back to SAFE. A fault cuts the gate, keeps measuring, and
remembers the first cause. ESTOP ends everything until the power is cycled.

The machine itself is the dictionary TRANSITIONS. A trigger that is not listed for a state does
nothing there. The diagram in docs/safety.md and the tables in the C code are made from it.
"""

from __future__ import annotations

from enum import IntEnum

from firmware_protocol.enums import BoardState


class Trigger(IntEnum):
    """What can move the board from one state to another."""

    SELF_TEST_PASSED = 0
    ARM_CONFIRMED = 1
    DISARM = 2
    SETPOINT_FRESH = 3
    SETPOINT_EXPIRED = 4
    HOLD_EXPIRED = 5
    COOLED = 6
    FAULT_RAISED = 7
    FAULT_CLEARED = 8
    ESTOP = 9


class PumpPolicy(IntEnum):
    """Who decides on the pumps in a state."""

    OFF = 0
    SETPOINT = 1
    COOL = 2
    BY_FAULT = 3


TRANSITIONS: dict[BoardState, dict[Trigger, BoardState]] = {
    BoardState.BOOT: {
        Trigger.SELF_TEST_PASSED: BoardState.SAFE,
        Trigger.FAULT_RAISED: BoardState.FAULT,
        Trigger.ESTOP: BoardState.ESTOP,
    },
    BoardState.SAFE: {
        Trigger.ARM_CONFIRMED: BoardState.ARMED,
        Trigger.FAULT_RAISED: BoardState.FAULT,
        Trigger.ESTOP: BoardState.ESTOP,
    },
    BoardState.ARMED: {
        Trigger.DISARM: BoardState.COOL,
        Trigger.SETPOINT_EXPIRED: BoardState.HOLD,
        Trigger.FAULT_RAISED: BoardState.FAULT,
        Trigger.ESTOP: BoardState.ESTOP,
    },
    BoardState.HOLD: {
        Trigger.SETPOINT_FRESH: BoardState.ARMED,
        Trigger.DISARM: BoardState.COOL,
        # The expiry itself raises SETPOINT_LOST, so that the fault is latched like any other.
        Trigger.HOLD_EXPIRED: BoardState.FAULT,
        Trigger.FAULT_RAISED: BoardState.FAULT,
        Trigger.ESTOP: BoardState.ESTOP,
    },
    BoardState.COOL: {
        Trigger.COOLED: BoardState.SAFE,
        Trigger.FAULT_RAISED: BoardState.FAULT,
        Trigger.ESTOP: BoardState.ESTOP,
    },
    BoardState.FAULT: {
        Trigger.FAULT_CLEARED: BoardState.SAFE,
        Trigger.ESTOP: BoardState.ESTOP,
    },
    BoardState.ESTOP: {},
}

STATE_OUTPUTS: dict[BoardState, tuple[bool, PumpPolicy]] = {
    # state: (gate may be on, who decides on the pumps)
    BoardState.BOOT: (False, PumpPolicy.OFF),
    BoardState.SAFE: (False, PumpPolicy.OFF),
    BoardState.ARMED: (True, PumpPolicy.SETPOINT),
    BoardState.HOLD: (True, PumpPolicy.SETPOINT),
    BoardState.COOL: (False, PumpPolicy.COOL),
    BoardState.FAULT: (False, PumpPolicy.BY_FAULT),
    BoardState.ESTOP: (False, PumpPolicy.OFF),
}

CURRENT_ALLOWED: frozenset[BoardState] = frozenset({BoardState.ARMED})

STATE_MEANING: dict[BoardState, str] = {
    BoardState.BOOT: "five samples; gate off",
    BoardState.SAFE: "gate off, pumps off; measures and reports",
    BoardState.ARMED: "current follows the setpoints below the ceilings",
    BoardState.HOLD: "setpoints stopped; current zero, waiting for a fresh one",
    BoardState.COOL: "gate off, pumps on until cold or until the time cap",
    BoardState.FAULT: "gate off, pumps as the first fault says; measures and reports",
    BoardState.ESTOP: "everything off until the power is cycled",
}

TRIGGER_MEANING: dict[Trigger, str] = {
    Trigger.SELF_TEST_PASSED: "self-test passed",
    Trigger.ARM_CONFIRMED: "ARM_CONFIRM with a valid token, every precondition met",
    Trigger.DISARM: "DISARM",
    Trigger.SETPOINT_FRESH: "fresh setpoint",
    Trigger.SETPOINT_EXPIRED: "no fresh setpoint for its ttl",
    Trigger.HOLD_EXPIRED: "no fresh setpoint while holding",
    Trigger.COOLED: "both springs cold, or time cap reached",
    Trigger.FAULT_RAISED: "a check trips",
    Trigger.FAULT_CLEARED: "CLEAR_FAULT of the first fault, cause gone and cold",
    Trigger.ESTOP: "ESTOP",
}
