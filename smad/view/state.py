"""What a page says beside its strips: the status in words, and what stands against arming.

Pure: from the daemon's status to what is shown. Texts of the bench (names, notes, events) go out
as they are; the page puts them in as text, never as markup.
"""

from collections.abc import Mapping

import msgspec
from msgspec import Struct

from firmware_protocol.enums import BoardState, Fault
from firmware_protocol.supervisor.faults import FAULT_TEXTS
from smad import api

EVENTS = 12
MODES = {int(state): state.name for state in BoardState}
"""The board's states by the number that a sample carries."""

NO_WORD = "UNKNOWN"
"""What the status says in place of a state while nothing comes from the board."""

MODE_MEANS: Mapping[str, str] = {
    "BOOT": "the board is starting",
    "SAFE": "no current can flow; it can be armed",
    "ARMED": "current flows when commanded",
    "HOLD": "no fresh setpoint came; current is zero",
    "COOL": "disarmed; water runs until the springs are cold",
    "FAULT": "a fault stopped it",
    "ESTOP": "stopped until its power is cycled",
    NO_WORD: "no word from the board",
}


LINK_MEANS: Mapping[str, str] = {
    "disconnected": "no port",
    "sync": "waiting for the board",
    "monitor": "connected",
    "ready": "connected, arming",
    "running": "connected, armed",
    "faulted": "connected, stopped by a fault",
}
LIMITED_BY: Mapping[str, str] = {
    "slew": "its rate of change",
    "maximum": "the maximum current",
    "i2t": "the heat of the last seconds (I²t)",
    "temperature": "the temperature",
    "gate": "the closed gate",
}
"""The link's state and the board's limiter, by their names in the status."""


def limiter_of(status: api.Status) -> str:
    """Return what limits the current of an armed board, in words; empty where nothing does."""
    if not status.motion.armed:
        return ""
    board, _, host = status.limiter.partition("; host: ")
    words = [LIMITED_BY.get(board, board)] if board != "none" else []
    return " and ".join((*words, *([f"limits of the host ({host})"] if host else [])))


class Condition(Struct, frozen=True):
    """Something that has to hold before the bench arms; with an `axis`, only to arm that one."""

    text: str
    holds: bool
    detail: str = ""
    axis: str = ""


class Trouble(Struct, frozen=True):
    """The first fault, in plain words."""

    number: int
    what: str
    cause: str
    remedy: str


class Tile(Struct, frozen=True, kw_only=True):
    """What is shown of each axis beside the one that is looked at; None: no reading."""

    axis: str
    mode: str
    running: str
    trouble: str
    displacement_mm: float | None
    rtd_x_degC: float | None
    rtd_y_degC: float | None


class BenchState(Struct, frozen=True, kw_only=True):
    """The status as the page shows it."""

    mode: str
    armed: bool
    running: str
    motion_number: int
    limiter: str
    warnings: tuple[str, ...]
    trouble: Trouble | None
    generation: int
    holder: str
    lease_left_s: float
    recorder: api.RecorderStatus
    link: str
    rate_hz: int
    setpoint_age_p99_ms: float | None
    counts: api.Counts
    events: tuple[api.Entry, ...]
    obstacle: str
    conditions: tuple[Condition, ...] = ()
    gains: Mapping[str, float | bool | str]


def bench_state(status: api.Status) -> BenchState:
    """Return what the page shows of `status`."""
    motion, age = status.motion, status.timing.setpoint_age
    return BenchState(
        mode=motion.mode,
        armed=motion.armed,
        running=motion.in_words(),
        motion_number=motion.number,
        limiter=limiter_of(status),
        warnings=status.warnings,
        trouble=_trouble(motion.fault),
        generation=motion.generation,
        holder=status.control.holder,
        lease_left_s=status.control.left_s,
        recorder=status.recorder,
        link=LINK_MEANS.get(status.link.state, status.link.state),
        rate_hz=status.link.rate_hz,
        setpoint_age_p99_ms=round(age.p99_us / 1e3, 2) if age.count else None,
        counts=status.counts,
        events=status.events[-EVENTS:],
        obstacle=status.obstacle,
        gains={k: v for k, v in msgspec.structs.asdict(status.gains).items() if v is not None},
    )


def _trouble(fault: api.Fault | None) -> Trouble | None:
    if fault is None:
        return None
    text = FAULT_TEXTS[Fault(fault.number)]
    return Trouble(
        number=fault.number,
        what=f"{fault.in_words()} (stopped by the {fault.by})",
        cause=text.cause,
        remedy=text.remedy,
    )


def control_condition(holder: str, *, ours: bool) -> Condition:
    """Return whether control stands against arming from a page that has it itself, or not."""
    free = ours or not holder
    return Condition("Nobody else has exclusive control", free, "" if free else f"{holder} has it")
