"""What protects the heater: everything that may switch it off must be a row of this table.

The simulated board, the host's mirror, the generated C and docs/safety.md are all made from it.
"""

from firmware_protocol.supervisor.errors import LimitError, SupervisorError
from firmware_protocol.supervisor.faults import FAULT_TEXTS, FaultText, explain
from firmware_protocol.supervisor.limits import (
    LIMIT_ROWS,
    Limits,
    compiled_limits,
    soft_range,
    tighten,
)
from firmware_protocol.supervisor.memory import Measurements, Memory, RTD_INVALID_cC
from firmware_protocol.supervisor.states import TRANSITIONS, Trigger
from firmware_protocol.supervisor.supervisor import (
    ArmConfirmed,
    ArmRequested,
    Disarmed,
    Event,
    FaultCleared,
    FirstFault,
    Link,
    Outcome,
    Restarted,
    SelfTest,
    SetpointArrived,
    Stopped,
    Supervisor,
)
from firmware_protocol.supervisor.table import CHECKS, Check

__all__ = [
    "CHECKS",
    "FAULT_TEXTS",
    "LIMIT_ROWS",
    "TRANSITIONS",
    "ArmConfirmed",
    "ArmRequested",
    "Check",
    "Disarmed",
    "Event",
    "FaultCleared",
    "FaultText",
    "FirstFault",
    "LimitError",
    "Limits",
    "Link",
    "Measurements",
    "Memory",
    "Outcome",
    "RTD_INVALID_cC",
    "Restarted",
    "SelfTest",
    "SetpointArrived",
    "Stopped",
    "Supervisor",
    "SupervisorError",
    "Trigger",
    "compiled_limits",
    "explain",
    "soft_range",
    "tighten",
]
