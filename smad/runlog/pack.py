"""Records to packed MCAP messages: JSON body, sequence number, and the time on the log's axis."""

import math
from collections.abc import Sequence
from typing import Any

import msgspec

from smad.runlog.mcap_file import CHANNEL_IDS, FIRST_AXIS_ID, Packed, pack
from smad.runlog.schema import Record, Row

_NS = 1_000_000_000
_LARGEST_TIME_NS = 2**63 - 1


def _plain_number(value: Any) -> Any:
    # numpy's scalars have item(); anything else is a mistake of the caller's.
    try:
        return value.item()
    except AttributeError:
        raise TypeError(f"a record holds a {type(value).__name__}, not a number") from None


class RecordPacker:
    """Packs the records of one file. Not for use by two threads at once.

    The time of a message is board time, moved once so that it starts at the host time of the first
    sample: evenly spaced as the board sampled, readable as a date, and untouched when somebody sets
    the host's clock in mid-run. It is moved anew, never back, with the first sample of a board that
    restarted. A record without board time takes its host time.
    """

    def __init__(self, started_unix_s: float, axes: Sequence[str] = ()) -> None:
        self._encode = msgspec.json.Encoder(enc_hook=_plain_number).encode
        self._axes = {name: number for number, name in enumerate(axes, start=FIRST_AXIS_ID)}
        self._sequences = dict.fromkeys((*CHANNEL_IDS.values(), *self._axes.values()), 0)
        self._offset_ns: int | None = None
        self._last_ns = _clip(_to_ns(started_unix_s) or 0)
        self._last_board_ns = self._last_row_ns = 0
        self.packed = 0

    def pack(self, record: Record, axis: str = "", time_s: float | None = None) -> Packed:
        """The message of a record. Raises TypeError for a field that JSON cannot hold.

        A sample of a named axis takes the Unix time `time_s`: the boards of several axes have a
        clock each, and the log has one.
        """
        body = self._encode(record)
        if b":null" in body and isinstance(record, Row):
            # A NaN was not measured either; viewers refuse a null where the schema has a number.
            body = self._encode(_without_nan(record))
        channel_id = self._axes[axis] if axis else CHANNEL_IDS[type(record)]
        sequence = self._sequences[channel_id]
        self._sequences[channel_id] = (sequence + 1) & 0xFFFFFFFF
        self.packed += 1
        stamp_ns = _to_ns(time_s) if axis else None
        time_ns = self._time_ns(record) if stamp_ns is None else _clip(stamp_ns)
        return pack(channel_id, sequence, time_ns, body)

    def _time_ns(self, record: Record) -> int:
        board_ns = _to_ns(record.t_s)
        host_ns = _to_ns(record.host_time_s)
        if board_ns is None:
            if host_ns is not None:
                self._last_ns = _clip(host_ns)
            return self._last_ns
        if self._offset_ns is None:
            self._offset_ns = (self._last_ns if host_ns is None else host_ns) - board_ns
        elif isinstance(record, Row) and board_ns < self._last_board_ns:
            self._offset_ns = max(self._last_row_ns, host_ns or 0) - board_ns
        self._last_ns = _clip(board_ns + self._offset_ns)
        if isinstance(record, Row):
            self._last_board_ns, self._last_row_ns = board_ns, self._last_ns
        return self._last_ns


def _without_nan(row: Row) -> Row:
    missing = {
        name: None
        for name, value in msgspec.structs.asdict(row).items()
        if name != "t_s" and isinstance(value, float) and math.isnan(value)
    }
    return msgspec.structs.replace(row, **missing)


def _to_ns(time_s: float | None) -> int | None:
    if time_s is None or not math.isfinite(time_s):
        return None
    # Before rounding: a time beyond all clocks, times 1e9, may be beyond all floats.
    return round(max(-_LARGEST_TIME_NS, min(time_s * _NS, _LARGEST_TIME_NS)))


def _clip(time_ns: int) -> int:
    return min(max(time_ns, 0), _LARGEST_TIME_NS)
