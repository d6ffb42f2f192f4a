"""The oracle: whether what followed a fault is what must follow one.

Seven clauses, each with a reason in words when it fails. Pure: an outcome in, violations out.
"""

from __future__ import annotations

import enum
from collections.abc import Callable
from dataclasses import dataclass

HOLD_S = 0.5
"""The board may resume by itself out of HOLD for so long, and never out of anything else."""

_HOLD_SLACK_S = 0.05
_AFTER_SAFE_J = 0.2
WIRE_MOST_DEGC = 150.0
"""What silicone tube and cement stand."""

_HOT = ("ARMED", "HOLD")


class Then(enum.Enum):
    """What must follow a fault."""

    STOPS = "the board must stop, and say why"
    MAY_STOP = "it may not show here; if the board stops, it must say why"
    GOES_ON = "the bench must go on, without a fault"
    RESTARTS = "the board restarts: off, and nothing latched"
    DISARMS = "the daemon disarms: off, and nothing latched"
    ENDS_OFF = "off, by a fault or by the daemon's disarm"


@dataclass(frozen=True)
class Expectation:
    """What must follow: the end, the faults that name the cause, and the heat that may go in."""

    then: Then
    faults: tuple[str, ...] = ()
    budget_J: float = 0.0
    host_is_told: bool = False
    """Whether the host must have learnt the board's first fault, the link being whole."""


@dataclass(frozen=True)
class LogFound:
    """A run log as it was read back. `flushed` rows must be there; `error` if it was unreadable."""

    rows: int
    flushed: int
    error: str = ""


@dataclass(frozen=True)
class Ending:
    """How the daemon ended, and how it had to: status, and words that its last line must hold."""

    status: int
    line: str
    wanted_status: int
    wanted_words: tuple[str, ...] = ()


@dataclass(frozen=True)
class Outcome:
    """What was injected, and what came of it. Times in s after the onset, heat in J."""

    name: str
    group: str
    scene: str
    injected: str
    expected: Expectation
    first_fault: str
    told_fault: str
    safe_after_s: float | None
    energy_J: float
    """Heat from the onset until safe; until the end of observation if it never was."""
    energy_after_safe_J: float
    hottest_degC: float
    """The hottest that a wire was after the onset, whatever its sensor said."""
    states: tuple[tuple[float, str], ...]
    """States with the time they began; the first is that at the onset, at 0."""
    gate_open_later: bool
    """Whether the gate was ever open again after it was safe."""
    host_running_later: bool
    """Whether the host believed itself armed at the end although the board was off."""
    log: LogFound | None = None
    ending: Ending | None = None
    not_refused: str = ""
    """What somebody was allowed to do who should have been refused; in words, else empty."""


@dataclass(frozen=True)
class Violation:
    """A clause that failed, and why."""

    clause: str
    reason: str


def judge(outcome: Outcome) -> list[Violation]:
    """Every clause that the outcome breaks; empty when all hold."""
    return [
        Violation(name, reason)
        for name, clause in CLAUSES.items()
        for reason in (clause(outcome),)
        if reason
    ]


def _energy(outcome: Outcome) -> str:
    budget_J = outcome.expected.budget_J
    # Written so that a NaN, on either side, fails too.
    if not outcome.energy_J <= budget_J:
        return f"{outcome.energy_J:.1f} J went in after the onset; the budget is {budget_J:.1f} J"
    if not outcome.energy_after_safe_J <= _AFTER_SAFE_J:
        return f"{outcome.energy_after_safe_J:.2f} J went in after the gate was off"
    return ""


def _wire(outcome: Outcome) -> str:
    if not outcome.hottest_degC <= WIRE_MOST_DEGC:
        return f"a wire reached {outcome.hottest_degC:.0f} °C; it stands {WIRE_MOST_DEGC:g} °C"
    return ""


def _cause(outcome: Outcome) -> str:
    expected, first = outcome.expected, outcome.first_fault
    off = outcome.safe_after_s is not None
    must_be_off = expected.then not in (Then.MAY_STOP, Then.GOES_ON)
    if must_be_off and not off:
        return f"it did not stop; {expected.then.value}"
    if expected.then is Then.GOES_ON and off:
        return f"it stopped ({first or 'nothing latched'}) for what is harmless"
    silent = expected.then in (Then.GOES_ON, Then.RESTARTS, Then.DISARMS)
    if silent and first:
        return f"the first fault is {first}, and there should be none"
    if first and first not in expected.faults:
        return f"the first fault is {first}, not {' or '.join(expected.faults)}"
    if expected.then in (Then.STOPS, Then.MAY_STOP) and off and not first:
        return "it stopped without naming a fault"
    if expected.host_is_told and first != outcome.told_fault:
        return f"the host was told {outcome.told_fault or 'nothing'}, the board latched {first}"
    return ""


def _rearm(outcome: Outcome) -> str:
    left = ""
    for n, (t_s, state) in enumerate(outcome.states):
        if state in _HOT and left:
            return f"{state} again {t_s:.2f} s after the onset, out of {left}"
        if state not in _HOT:
            left = left or state
        followed = outcome.states[n + 1] if n + 1 < len(outcome.states) else None
        if state == "HOLD" and followed is not None and followed[1] == "ARMED":
            held_s = followed[0] - t_s
            if held_s > HOLD_S + _HOLD_SLACK_S:
                return f"resumed out of HOLD after {held_s:.2f} s; {HOLD_S:g} s are allowed"
    if outcome.gate_open_later:
        return "the gate was open again after it was safe"
    if outcome.host_running_later:
        return "the host still took the bench for armed at the end"
    return ""


def _log(outcome: Outcome) -> str:
    log = outcome.log
    if log is None:
        return ""
    if log.error:
        return f"the run log cannot be read: {log.error}"
    if log.rows < log.flushed:
        return f"the run log holds {log.rows} samples of {log.flushed} that were flushed"
    return ""


def _ending(outcome: Outcome) -> str:
    ending = outcome.ending
    if ending is None:
        return ""
    if ending.status != ending.wanted_status:
        return (
            f"the daemon ended with status {ending.status}, not {ending.wanted_status}: "
            f"{ending.line!r}"
        )
    for words in ending.wanted_words:
        if words not in ending.line:
            return f"its last line does not say {words!r}: {ending.line!r}"
    return ""


def _refusal(outcome: Outcome) -> str:
    return outcome.not_refused


CLAUSES: dict[str, Callable[[Outcome], str]] = {
    "energy": _energy,
    "wire": _wire,
    "cause": _cause,
    "rearm": _rearm,
    "log": _log,
    "ending": _ending,
    "refusal": _refusal,
}
"""Each clause returns why it fails, or nothing."""
