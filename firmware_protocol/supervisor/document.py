"""The tables and the diagram of docs/safety.md, made from the supervisor's tables.

They stand between `<!-- generated: name -->` and `<!-- end -->`.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence

from firmware_protocol.enums import BoardState, Channel
from firmware_protocol.supervisor.errors import DocumentError
from firmware_protocol.supervisor.faults import FAULT_TEXTS
from firmware_protocol.supervisor.host import HOST_ROWS, host_limits
from firmware_protocol.supervisor.limits import LIMIT_ROWS, compiled_limits
from firmware_protocol.supervisor.states import (
    STATE_MEANING,
    TRANSITIONS,
    TRIGGER_MEANING,
)
from firmware_protocol.supervisor.table import CHECKS, Check

_MARKED = re.compile(r"(<!-- generated: (\w+) -->\n).*?(<!-- end -->)", re.DOTALL)
OF_THE_HOST = frozenset({"arming"})
"""Parts of the page that the host's own documentation makes."""
_LIMIT_NAME = re.compile(r"\{(\w+)\}")


def fill(text: str) -> str:
    """Return the document with each marked part made anew.

    Raises DocumentError for a marker that names nothing, or a part without a marker.
    """
    markers = [name for _, name, _ in _MARKED.findall(text)]
    unknown, missing = set(markers) - set(PARTS) - OF_THE_HOST, set(PARTS) - set(markers)
    if unknown or missing:
        raise DocumentError(
            f"docs/safety.md: markers that name nothing: {sorted(unknown) or 'none'}, "
            f"parts without a marker: {sorted(missing) or 'none'}"
        )
    return _MARKED.sub(
        lambda m: m[0] if m[2] in OF_THE_HOST else m[1] + PARTS[m[2]]() + m[3],
        text,
    )


def shown(name: str) -> str:
    """Return a limit's compiled value with a unit people use: `9500 cC` as `95 °C`."""
    row = LIMIT_ROWS[name]
    return in_words(row.compiled, row.unit)


def in_words(value: int, unit: str) -> str:
    """Return a raw value in the unit people use."""
    scales = {"cC": (100, "°C"), "us": (1_000_000, "s"), "mV": (1000, "V"), "mJ": (1000, "J")}
    scales |= {"permille": (10, "%"), "cC/s": (100, "K/s")}
    if unit == "us" and abs(value) < 1_000_000:
        return f"{value / 1000:g} ms"
    if unit in scales:
        divisor, name = scales[unit]
        return f"{value / divisor:g} {name}"
    return f"{value} {unit}".strip()


def _table(head: tuple[str, ...], rows: Sequence[tuple[str, ...]]) -> str:
    lines = [head, tuple("---" for _ in head), *rows]
    return "".join("| " + " | ".join(line) + " |\n" for line in lines)


def _diagram() -> str:
    lines = ["```mermaid", "stateDiagram-v2", "    [*] --> BOOT"]
    for state, arrows in TRANSITIONS.items():
        lines += [
            f"    {state.name} --> {following.name}: {TRIGGER_MEANING[trigger]}"
            for trigger, following in arrows.items()
        ]
    return "\n".join([*lines, "```"]) + "\n"


def _states() -> str:
    return _table(
        ("state", "what it does"), [(state.name, STATE_MEANING[state]) for state in BoardState]
    )


def _checks() -> str:
    rows = []
    for check in CHECKS:
        when = _LIMIT_NAME.sub(lambda match: shown(match[1]), check.trips_when)
        channels = _CHANNELS.get(
            frozenset(check.channels), ", ".join(channel.name for channel in check.channels)
        )
        states = ", ".join(state.name for state in BoardState if state in check.states)
        states = states.replace("SAFE, ARMED, HOLD, COOL, FAULT", "always")
        states = states.replace("ARMED, HOLD", "armed")
        rows.append((check.fault.name, channels, when, _debounce(check), states))
    head = ("fault", "channels", "trips when", "for", "watched in")
    dry = [fault.name for fault, text in FAULT_TEXTS.items() if fault and not text.pumps]
    pumps = "In FAULT pumps run until cold or capped, or while current flows, but not after "
    return f"{_table(head, rows)}\n{pumps}{', '.join(dry)}.\n"


_CHANNELS = {
    frozenset((Channel.SPRING_X, Channel.SPRING_Y)): "springs",
    frozenset((Channel.SPRING_X, Channel.SPRING_Y, Channel.INLET, Channel.AMBIENT)): "RTDs",
}


def _debounce(check: Check) -> str:
    samples = LIMIT_ROWS[check.samples].compiled
    parts = [f"{samples} samples"] if samples > 1 else []
    parts += [shown(check.time)] if check.time else []
    return " and ".join(parts) or "at once"


def _limits() -> str:
    """The limits that a parameter may tighten; the other ones stand in the checks."""
    rows = [
        (str(row.number), f"`{name}`", str(row.compiled), str(row.tightest), row.reason)
        for name, row in LIMIT_ROWS.items()
        if row.number
    ]
    return _table(("number", "limit", "compiled", "tightest", "reason"), rows)


def _host() -> str:
    limits = host_limits(compiled_limits())
    rows = [
        (
            row.meaning,
            in_words(getattr(limits, name), LIMIT_ROWS[row.board].unit),
            f"`{row.board}` {shown(row.board)}",
        )
        for name, row in HOST_ROWS.items()
    ]
    return _table(("the host", "at", "the board, by"), rows)


def _faults() -> str:
    """Number, name and unit of every fault; cause and remedy are what `smad faults` prints."""
    return "".join(
        f"{int(fault)}. {fault.name}{f' ({text.unit})' if text.unit else ''}\n"
        for fault, text in FAULT_TEXTS.items()
        if fault
    )


PARTS: dict[str, Callable[[], str]] = {
    "diagram": _diagram,
    "states": _states,
    "checks": _checks,
    "limits": _limits,
    "host": _host,
    "faults": _faults,
}
