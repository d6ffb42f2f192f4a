"""The tables of docs/protocol.md, put between `<!-- generated: name -->` and `<!-- end -->`."""

from __future__ import annotations

import enum
import re
from collections.abc import Callable, Sequence

from firmware_protocol import (
    board,
    framing,
    greeting,
    host,
    rates,
    replies,
    reports,
    requests,
    timesync,
)
from firmware_protocol.codec import Codec
from firmware_protocol.enums import Fault
from firmware_protocol.errors import SchemaError
from firmware_protocol.generate.c_names import enums_of
from firmware_protocol.messages import PROTOCOL_MAJOR, PROTOCOL_MINOR, Message
from firmware_protocol.parameters import PARAMETERS
from firmware_protocol.schema import own_crc, wire_name
from firmware_protocol.supervisor.limits import LIMIT_ROWS
from firmware_protocol.wire import Field, fields_of

_MARKED = re.compile(r"(<!-- generated: (\w+) -->\n).*?(<!-- end -->)", re.DOTALL)


def fill(text: str, codec: Codec) -> str:
    """Return the document with each marked table made anew.

    Raises SchemaError for a marker that names no table, or a table without a marker.
    """
    markers = [name for _, name, _ in _MARKED.findall(text)]
    unknown, missing = set(markers) - set(TABLES), set(TABLES) - set(markers)
    if unknown or missing:
        raise SchemaError(
            f"docs/protocol.md: markers without a table: {sorted(unknown) or 'none'}, "
            f"tables without a marker: {sorted(missing) or 'none'}"
        )
    return _MARKED.sub(lambda match: match[1] + TABLES[match[2]](codec) + match[3], text)


def table(head: tuple[str, ...], rows: Sequence[tuple[str, ...]]) -> str:
    """Return a Markdown table."""
    lines = [head, tuple("---" for _ in head), *rows]
    return "".join("| " + " | ".join(line) + " |\n" for line in lines)


def _frame(codec: Codec) -> str:
    rows = [
        ("longest frame before COBS", f"{framing.MAX_DECODED} bytes"),
        ("longest payload", f"{framing.MAX_PAYLOAD} bytes"),
        ("longest frame on the wire, delimiter included", f"{framing.MAX_ENCODED + 1} bytes"),
        ("protocol version", f"{PROTOCOL_MAJOR}.{PROTOCOL_MINOR}"),
        ("schema CRC of this version", f"`0x{own_crc():08x}`"),
    ]
    return table(("quantity", "value"), rows)


def _upper(name: str) -> str:
    return re.sub("(?<!^)(?=[A-Z])", "_", name).upper()


def _fields(codec: Codec) -> str:
    return "\n".join(_one_message(codec, cls) for cls in codec.messages)


def _one_message(codec: Codec, cls: type[Message]) -> str:
    doc = " ".join((cls.__doc__ or "").split())
    replies = f" → {', '.join(map(_upper, cls.info.replies))}" if cls.info.replies else ""
    text = f"### {wire_name(cls)}{' ❄' if cls.info.frozen else ''}\n\n`0x{cls.info.number:02x}`, "
    text += f"{codec.layout(cls).size} bytes, {cls.info.pace}{replies}. {doc}\n\n"
    for field in fields_of(cls):
        meaning = "" if field.name in _TOLD_ONCE else f": {_meaning(field)}"
        text += f"- `{field.name}` {_kind(field)}{meaning}\n"
    return text


_TOLD_ONCE = ("axis",)
"""Fields of many messages that the page explains above them."""


def _kind(field: Field) -> str:
    if field.record is not None:
        return wire_name(field.record)
    return field.wire.kind + (f"[{field.wire.count}]" if field.wire.count > 1 else "")


def _meaning(field: Field) -> str:
    notes = [field.wire.doc]
    if field.enum is not None:
        notes.append(f"one of {field.enum.__name__}")
    if field.wire.bits is not None:
        notes.append(f"bits of {field.wire.bits.__name__}")
    if field.wire.invalid is not None:
        notes.append(f"{field.wire.invalid} is none")
    return "; ".join(note for note in notes if note)


_A_LINE = 12
"""Members of an enumeration in a line of the page."""


def _enums(codec: Codec) -> str:
    text = ""
    for kind in enums_of(codec):
        if kind is Fault:
            continue
        is_bits = issubclass(kind, enum.IntFlag)
        members = [
            f"{f'0x{member.value:x}' if is_bits else member.value} {member.name}" for member in kind
        ]
        lines = [", ".join(members[n : n + _A_LINE]) for n in range(0, len(members), _A_LINE)]
        text += f"- {kind.__name__}: " + ";\n  ".join(lines) + "\n"
    return text


def _parameters(codec: Codec) -> str:
    return "".join(
        f"- {p.number} `{p.name}` = {p.default} {p.unit}".rstrip()
        + f" ({p.allowed}): {p.doc}{'; one for the board' if p.shared else ''}\n"
        for p in PARAMETERS
        if p.name not in LIMIT_ROWS
    )


def _rates(codec: Codec) -> str:
    head = ("Bd", *(f"{rate} Hz" for rate in rates.USUAL_RATES_HZ))
    rows = [
        (str(baud), *(_share(rates.load(rate, baud)) for rate in rates.USUAL_RATES_HZ))
        for baud in rates.USUAL_BAUDS
    ]
    return table(head, rows)


def _share(load: rates.Load) -> str:
    return f"{load.share:.0%}" if load.fits else f"~~{load.share:.0%}~~"


def _numbers(codec: Codec) -> str:
    first, *_, last = greeting.INTERVALS_US
    rows = [
        ("HELLO repeated after", f"{first // 1000} ms, growing to {last // 1000} ms", "host"),
        ("tries of a request", f"{requests.TRIES}, of PARAM_SAVE {requests.SAVE_TRIES}", "host"),
        ("first time to wait for an answer", f"{requests.FIRST_RTO_US // 1000} ms", "host"),
        ("shortest time to wait", f"{requests.LEAST_RTO_US // 1000} ms", "host"),
        ("requests without an answer that end a session", str(host.TIMEOUT_LIMIT), "host"),
        ("no sample for so long ends a session", f"{host.SILENCE_US // 1000} ms", "host"),
        ("frames of another session that end a session", str(host.FOREIGN_LIMIT), "host"),
        ("copies of ESTOP", str(host.ESTOP_COPIES), "host"),
        ("oldest setpoint accepted", f"{board.MAX_SETPOINT_AGE_US // 1000} ms", "board"),
        ("copies of FAULT_REPORT", str(reports.COPIES), "board"),
        ("complaints (ERROR that answers no request)", f"{replies.ERRORS_PER_SECOND} /s", "board"),
        ("exchanges that lock the clock", str(timesync.LOCK_EXCHANGES), "host"),
    ]
    return "".join(f"- {quantity}: {value} ({end})\n" for quantity, value, end in rows)


TABLES: dict[str, Callable[[Codec], str]] = {
    "frame": _frame,
    "fields": _fields,
    "enums": _enums,
    "parameters": _parameters,
    "rates": _rates,
    "numbers": _numbers,
}
