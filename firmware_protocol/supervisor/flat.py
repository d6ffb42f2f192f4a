"""The tables of states and faults as plain tuples, the way the machine and the C code read them."""

from __future__ import annotations

from firmware_protocol.enums import BoardState, Fault
from firmware_protocol.supervisor import states
from firmware_protocol.supervisor.faults import FAULT_TEXTS
from firmware_protocol.supervisor.states import Trigger

TRIGGER_COUNT = len(Trigger)

TRANSITION: tuple[int, ...] = tuple(
    int(states.TRANSITIONS[state].get(trigger, -1)) for state in BoardState for trigger in Trigger
)
"""Following state by state * TRIGGER_COUNT + trigger; -1 where the trigger does nothing."""

GATE: tuple[int, ...] = tuple(int(states.STATE_OUTPUTS[state][0]) for state in BoardState)
PUMP_POLICY: tuple[int, ...] = tuple(int(states.STATE_OUTPUTS[state][1]) for state in BoardState)
CURRENT_ALLOWED: tuple[int, ...] = tuple(
    int(state in states.CURRENT_ALLOWED) for state in BoardState
)
FAULT_PUMPS: tuple[int, ...] = tuple(int(FAULT_TEXTS[fault].pumps) for fault in Fault)
"""Whether the pumps run, by number of the first fault."""
