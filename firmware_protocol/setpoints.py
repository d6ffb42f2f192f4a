"""Setpoints at both ends: the host's slot, where the latest wins, and the board's door."""

from __future__ import annotations

WRAP = 1 << 32

AMBIGUOUS = 128
"""With so many setpoints unacknowledged, an 8-bit number no longer tells which one is meant."""


class SetpointSlot:
    """Holds at most one setpoint per axis until it is sent, and follows what was acknowledged."""

    def __init__(self) -> None:
        self._waiting: dict[int, bytes] = {}
        self._sent = 0
        self._acknowledged: dict[int, int] = {}
        self._last_of_axis: dict[int, int] = {}

    def offer(self, axis: int, payload: bytes) -> bool:
        """Put a packed setpoint in; return whether one never sent had to make way."""
        replaced = axis in self._waiting
        self._waiting[axis] = payload
        return replaced

    def take(self) -> list[tuple[int, bytes]]:
        """Return the payloads to send now, each with its sequence number."""
        if not self._waiting:
            return []
        taken = []
        for axis, payload in self._waiting.items():
            self._sent += 1
            self._last_of_axis[axis] = self._sent
            taken.append((self._sent & 0xFF, payload))
        self._waiting.clear()
        return taken

    def acknowledge(self, axis: int, seq: int) -> int | None:
        """Return how many setpoints `seq` leaves unacknowledged, None if it cannot be true."""
        last = self._last_of_axis.get(axis, 0)
        before = self._acknowledged.get(axis, 0)
        pending = (last - seq) & 0xFF
        if pending > last - before and last - before < AMBIGUOUS:
            return None
        self._acknowledged[axis] = max(before, last - pending)
        return pending


class SetpointGate:
    """The board's door for setpoints: old ones, and ones that were overtaken, stay outside.

    What came last is remembered by the board's whole clock. By the 32 bits of the wire, whatever
    came after a pause of 36 to 72 minutes would lie before it. In C: `smad_setpoint_gate_admit`.
    """

    def __init__(self, max_age_us: int) -> None:
        self._max_age_us = max_age_us
        self._last: dict[int, tuple[int, int]] = {}

    def admit(self, axis: int, t_ref_us: int, seq: int, now_us: int) -> int | None:
        """Return the age in µs of a setpoint that may pass, None for one that may not.

        `now_us` is the board's time, not wrapped; `t_ref_us` has 32 bits, as on the wire. A
        reference time in the future is as wrong as one too far back: modulo 2³² it is older than
        anything.
        """
        age_us = (now_us - t_ref_us) % WRAP
        if age_us > self._max_age_us:
            return None
        ref_us = now_us - age_us
        if axis in self._last:
            last_ref_us, last_seq = self._last[axis]
            step = (seq - last_seq) & 0xFF
            if ref_us < last_ref_us or (ref_us == last_ref_us and not 0 < step < 128):
                return None
        self._last[axis] = (ref_us, seq)
        return age_us

    def open_for(self, axis: int) -> bool:
        """Whether a setpoint for this axis has passed."""
        return axis in self._last
