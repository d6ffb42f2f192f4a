"""What follows from the board's messages that are no samples: connection, faults, parameters.

A session always begins as a watcher's: nothing is armed, whatever was before.
"""

import asyncio
from collections.abc import Callable

from msgspec import structs

from firmware_protocol.enums import BoardState, faults_in
from firmware_protocol.events import (
    BoardRestarted,
    Connected,
    ErrorReceived,
    FaultReported,
    HostEvent,
    Incompatible,
    IncompatibleReason,
    LinkLost,
    StatsReceived,
)
from firmware_protocol.messages import FaultGet, FaultReport, Ident, Message, State
from firmware_protocol.mirror import STOPPED
from smad import api
from smad.config import LinkConfig
from smad.control.sample import Scales
from smad.daemon.errors import Refusal
from smad.daemon.link.board import Parameters, fault_of
from smad.daemon.link.requests import BoardRequests, refusal
from smad.daemon.services import Services

READ_AGAIN_US = 500_000
_LAST_REPORT = 255
"""The largest number of a fault report: later ones replace each other there."""


class BoardWatch:
    """Keeps what is known of the board, and tells the journal and the run log what changes.

    `on_scales` gets the scales of the readings once the parameters are read; `baud` tells the speed
    of the line as it was opened, 0 for none; `identified` is set once it was heard of;
    `incompatible` holds why this board cannot be used, or only be watched.
    """

    def __init__(
        self,
        config: LinkConfig,
        requests: BoardRequests,
        services: Services,
        *,
        baud: Callable[[], int],
        on_scales: Callable[[Scales], None],
    ) -> None:
        self.parameters = Parameters(config.axis)
        self.ident: Ident | None = None
        self.incompatible: Incompatible | None = None
        self.fault: api.Fault | None = None
        self.mode: BoardState | None = None
        self.stats: dict[str, int] = {}
        self.identified = asyncio.Event()
        self.reading = False
        self._read_again_us = 0
        self._config = config
        self._requests = requests
        self._say = services.say
        self._spawn = services.spawn
        self._baud = baud
        self._on_scales = on_scales

    def on_event(self, event: HostEvent) -> None:
        """Take one event of the session."""
        if self._requests.handle(event):
            return
        match event:
            case Connected(ident):
                self._connected(ident)
            case Incompatible():
                self._incompatible(event)
            case FaultReported(report):
                self.fault = fault_of(report)
                text = f"the board stopped: {self.fault.in_words()}"
                self._say("fault", text, structs.asdict(self.fault))
            case BoardRestarted(ident):
                cause = "" if ident is None else f" ({ident.reset_cause.name.lower()})"
                self._disconnected(f"the board restarted{cause}; it is not armed any more")
            case LinkLost(silent_us):
                self._disconnected(f"the board sent nothing for {silent_us / 1000:.0f} ms")
            case StatsReceived(stats):
                self.stats = {name: getattr(stats, name) for name in stats.__struct_fields__}
            case ErrorReceived(error):
                self._say("warning", f"the board reports an error: {refusal(error)}", {})
            case _:
                pass

    def port_lost(self, reason: str) -> None:
        """The port went away."""
        self._disconnected(f"the port was lost ({reason}); trying to reopen it")

    def on_state(self, state: State) -> None:
        """Take the mode of a published sample; notes changes."""
        mode = state.mode
        if mode == self.mode:
            return
        before, self.mode = self.mode, BoardState(mode)
        if mode in STOPPED and self.fault is None:
            # It was latched before this session, or every copy of its report was lost.
            self._spawn("fault report", self._read_fault(state))
        if before is None:
            return
        self._say("state", f"{before.name} → {self.mode.name}", {})
        if mode not in STOPPED and before is BoardState.FAULT:
            self.fault = None

    def _connected(self, ident: Ident) -> None:
        self.ident = ident
        self.incompatible = None
        self.fault = None
        self.mode = None
        self.reading = True
        self.identified.set()
        self._say(
            "link",
            f"connected to {ident.firmware} ({ident.uid.hex()}), boot {ident.boot_count}, "
            f"{ident.state_rate_hz} Hz; monitoring, not armed",
            {},
        )
        opened = self._baud()
        if opened and ident.baud and ident.baud != opened:
            self._say(
                "warning",
                f"the board's line runs at {ident.baud} baud, the port was opened with {opened} "
                "(only a pseudo-terminal or plain USB carries that); "
                f"set link.baud = {ident.baud}",
                {},
            )
        self._spawn("parameters", self._learn(ident))

    def _incompatible(self, event: Incompatible) -> None:
        self.incompatible = event
        self.identified.set()
        if event.reason is IncompatibleReason.MAJOR:
            text = f"this board cannot be used: {event.fields[0]}"
        else:
            text = f"only watching, arming is refused: {disagreement(event)}"
        self._say("link", text, {"fields": list(event.fields)})

    def _disconnected(self, text: str) -> None:
        if self.ident is not None or self.mode is not None:
            self._say("link", text, {})
        self.ident = None
        self.mode = None
        self.incompatible = None
        self.parameters.complete = False

    async def _read_fault(self, state: State) -> None:
        """Learn of a fault of which no report came; the board tells it on being asked."""
        standing = faults_in(state.faults)
        fault: api.Fault | None = None
        report = await self._last_report()
        if isinstance(report, FaultReport) and report.fault in standing:
            fault = fault_of(report)
        if fault is None and standing:
            fault = api.Fault(number=int(standing[0]), name=standing[0].name)
        # Meanwhile it may have been reported, or cleared.
        if fault is not None and self.fault is None and self.mode in STOPPED:
            self.fault = fault
            text = f"the board had stopped: {fault.in_words()}"
            self._say("fault", text, structs.asdict(fault))

    async def _last_report(self) -> Message | None:
        """Return the board's last fault report, which is of the fault that stands; None: none."""
        index = _LAST_REPORT
        while True:
            try:
                return await self._requests.ask(FaultGet(self._config.axis, index))
            except Refusal as refused:
                # A report that is not there is refused with how many there are.
                count = refused.limit
                if not isinstance(count, int) or not 0 < count <= index:
                    return None
                index = count - 1

    def rescale(self) -> None:
        """Use the parameters as they now are for the readings."""
        self._on_scales(Scales(self.parameters.values, self._config.axis))

    def tick(self, now_us: int) -> None:
        """Read the parameters again where they could not be read."""
        if self.ident is None or self.reading or self.parameters.complete:
            self._read_again_us = now_us + READ_AGAIN_US
        elif now_us >= self._read_again_us and not self._requests.watch_only:
            self.reading = True
            self._spawn("parameters", self._learn(self.ident))

    async def _learn(self, ident: Ident) -> None:
        try:
            if self._requests.watch_only:
                return
            await self.parameters.read(ident, self._requests.ask)
            self.rescale()
        except Refusal as error:
            if ident is self.ident:
                text = f"the board's parameters were not read, and will be read again: {error}"
                self._say("warning", text, {})
            return
        finally:
            self.reading &= ident is not self.ident
        await self._set_rate(ident)

    async def _set_rate(self, ident: Ident) -> None:
        rate_hz = self._config.rate_hz
        if ident.state_rate_hz == rate_hz:
            return
        try:
            await self.parameters.set("state_rate_hz", rate_hz, self._requests.ask)
        except Refusal as error:
            text = f"the board's rate stays at {ident.state_rate_hz} Hz, not {rate_hz}: {error}"
            self._say("warning", text, {})
            return
        self._say("link", f"set the board's rate from {ident.state_rate_hz} to {rate_hz} Hz", {})


def disagreement(event: Incompatible) -> str:
    """Return what differs between board and host, in one line."""
    differences = "; ".join(event.fields[:3]) or "its description has not been read yet"
    more = len(event.fields) - 3
    return differences + (f"; and {more} more" if more > 0 else "")
