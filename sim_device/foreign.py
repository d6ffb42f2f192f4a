"""Message tables that differ from ours, for boards with older and newer firmware."""

from __future__ import annotations

from typing import Annotated

from firmware_protocol.codec import Codec
from firmware_protocol.messages import MESSAGES, FaultGet, Message
from firmware_protocol.wire import Direction, MessageInfo, Wire


class Rinse(Message, frozen=True, gc=False):
    """A message that only a newer board knows."""

    info = MessageInfo(number=0x7F, direction=Direction.TO_BOARD, pace="request", replies=("Done",))
    axis: Annotated[int, Wire("u8", "actuator pair, counted from 0")]
    seconds: Annotated[int, Wire("u16", "how long", unit="s")]


OLDER = Codec([cls for cls in MESSAGES if cls is not FaultGet])
"""A table from before faults could be read again."""

NEWER = Codec([*MESSAGES, Rinse])
