"""What the board does with each event of its session: the supervisor decides, the host is told."""

from __future__ import annotations

import random
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from firmware_protocol import events as heard
from firmware_protocol import messages as wire
from firmware_protocol.enums import ErrorCode
from firmware_protocol.events import BoardEvent, Request
from firmware_protocol.supervisor import (
    ArmConfirmed,
    ArmRequested,
    Disarmed,
    FaultCleared,
    Link,
    Outcome,
    Stopped,
)

if TYPE_CHECKING:
    from sim_device.board import Board

STAGE_FIELD = wire.Setpoint.__struct_fields__.index("stage_um")


class Commands:
    """The board's table of events and what each does. `rng` makes the arming tokens."""

    def __init__(self, board: Board, rng: random.Random) -> None:
        self._board = board
        self._rng = rng
        self._agreed_crc: int | None = None
        self._actions: dict[type[BoardEvent], Callable[[Any, int], None]] = {
            heard.SetpointReceived: self._setpoint,
            heard.ArmRequested: self._arm_request,
            heard.ArmConfirmed: self._arm_confirm,
            heard.DisarmRequested: self._disarm,
            heard.ClearFaultRequested: self._clear,
            heard.EstopReceived: self._estop,
            heard.SessionStarted: self._session,
            heard.ParameterChanged: self._parameter,
            heard.ParameterSaveRequested: self._save,
        }

    def act(self, event: BoardEvent, now_us: int) -> None:
        """Act on one event."""
        self._actions[type(event)](event, now_us)

    def new_token(self) -> int:
        """Return a token that was not used lately."""
        return self._rng.randrange(1, 1 << 32)

    def link(self) -> Link:
        """What host and board agree on.

        The session compares the parameters when arming is asked for; they must not have changed
        by the time it is confirmed.
        """
        board = self._board
        session = board.session
        return Link(
            session=session.session != 0,
            schema=session.schema_agrees,
            parameters=board.parameters.crc == self._agreed_crc,
            clock=board.outputs.dt_us <= 2 * board.period_us,
        )

    def _setpoint(self, event: heard.SetpointReceived, now_us: int) -> None:
        board = self._board
        refused = board.apply_setpoint(event.setpoint, event.seq, event.age_us, now_us)
        # Not armed, or too old: STATE tells. That a stage does not go so far, nothing else tells.
        if refused == ErrorCode.OUT_OF_RANGE:
            limit = board.outputs.limit
            board.session.refuse_setpoint(event, ErrorCode(refused), STAGE_FIELD, limit, now_us)

    def _arm_request(self, event: heard.ArmRequested, now_us: int) -> None:
        token = self.new_token()
        self._agreed_crc = event.message.param_crc
        outcome = self._board.command(ArmRequested(self.link(), token), now_us)
        if self._granted(event.request, outcome, now_us):
            valid_ms = self._board.supervisor.limits.token_us // 1000
            self._board.session.reply(event.request, wire.ArmToken(0, token, valid_ms), now_us)

    def _arm_confirm(self, event: heard.ArmConfirmed, now_us: int) -> None:
        outcome = self._board.command(ArmConfirmed(self.link(), event.message.token), now_us)
        self._answer(event.request, outcome, now_us)

    def _disarm(self, event: heard.DisarmRequested, now_us: int) -> None:
        self._answer(event.request, self._board.command(Disarmed(), now_us), now_us)

    def _clear(self, event: heard.ClearFaultRequested, now_us: int) -> None:
        outcome = self._board.command(FaultCleared(event.message.fault), now_us)
        self._answer(event.request, outcome, now_us)

    def _estop(self, event: heard.EstopReceived, now_us: int) -> None:
        self._board.command(Stopped(), now_us)

    def _session(self, event: heard.SessionStarted, now_us: int) -> None:
        # A host that comes back must arm again; one that took over never armed at all.
        self._board.command(Disarmed(), now_us)

    def _parameter(self, event: heard.ParameterChanged, now_us: int) -> None:
        self._board.apply_parameters()

    def _save(self, event: heard.ParameterSaveRequested, now_us: int) -> None:
        self._board.save_parameters()
        self._board.session.done(event.request, now_us)

    def _answer(self, request: Request, outcome: Outcome, now_us: int) -> None:
        if self._granted(request, outcome, now_us):
            self._board.session.done(request, now_us)

    def _granted(self, request: Request, outcome: Outcome, now_us: int) -> bool:
        """Return whether the outcome is good; if not, tell the host why."""
        if outcome.code is None:
            return True
        self._board.session.reject(
            request, outcome.code, outcome.channel, outcome.limit, now_us, value=outcome.value
        )
        return False
