"""What a host may have written: current only while it is armed, and only in its own session."""

from __future__ import annotations

from collections.abc import Iterable

from campaign.fuzz.program import require
from firmware_protocol import messages as m
from firmware_protocol.codec import CODEC
from firmware_protocol.events import HostState
from firmware_protocol.framing import Frame
from firmware_protocol.host import HostSession

MOST_mA = 4000


def check_setpoints(frames: Iterable[Frame], session: HostSession) -> None:
    """Require of every SETPOINT among the frames that the host may send it now."""
    for frame in frames:
        if frame.type != m.Setpoint.info.number:
            continue
        setpoint = CODEC.unpack(frame.type, frame.payload)
        assert isinstance(setpoint, m.Setpoint)
        driven = any(setpoint.i_mA) or any(setpoint.pump_duty)
        require(
            not driven or session.state is HostState.RUNNING,
            "{} was sent in {}",
            setpoint,
            session.state,
        )
        require(max(setpoint.i_mA) <= MOST_mA, "{} is over {} mA", setpoint, MOST_mA)
        require(frame.session == session.session, "a setpoint of another session was sent")
