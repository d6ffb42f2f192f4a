"""What each end counts."""

from __future__ import annotations

import msgspec

from firmware_protocol.framing import DecoderStats


class HostLinkStats(msgspec.Struct):
    """What a host session has counted since it was made; `decoder` counts damaged frames."""

    decoder: DecoderStats
    states: int = 0
    missed_states: int = 0
    old_states: int = 0
    session_errors: int = 0
    payload_errors: int = 0
    unknown_types: int = 0
    not_understood: int = 0
    echoes: int = 0
    ack_errors: int = 0
    repeats: int = 0
    timeouts: int = 0
    unmatched_replies: int = 0
    unhandled: int = 0
    """Messages of the table that the session does nothing with."""
    setpoints_sent: int = 0
    setpoints_dropped: int = 0
    other_axes: int = 0
    """Samples of an axis that the host does not use."""


class BoardLinkStats(msgspec.Struct):
    """What a board session has counted since boot; `decoder` counts damaged frames."""

    decoder: DecoderStats
    payload_errors: int = 0
    session_errors: int = 0
    stale_setpoints: int = 0
    repeated_requests: int = 0
    busy_requests: int = 0
    dropped_states: int = 0
    dropped_frames: int = 0
    dropped_errors: int = 0
    echoes: int = 0
    unhandled: int = 0
    """Messages of the table that the session does nothing with."""
