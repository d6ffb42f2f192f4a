"""A host session in lockstep with a simulated bench: bytes both ways, no port, no wall clock."""

from collections.abc import Callable

from firmware_protocol import messages as wire
from firmware_protocol.enums import BoardState
from firmware_protocol.events import (
    BoardRestarted,
    Connected,
    FaultReported,
    HostEvent,
    HostState,
    RequestDone,
    RequestFailed,
    StateReceived,
    StatsReceived,
)
from firmware_protocol.host import HostSession
from sim_device.bench import SimulatedBench

Answer = Callable[[wire.State], wire.Setpoint | None]


class Loop:
    """Drives a bench with a host session. `answer` gives the setpoint for each STATE."""

    def __init__(self, bench: SimulatedBench, nonce: int = 11) -> None:
        self.bench = bench
        self.host = HostSession(nonce=nonce)
        self.answer: Answer = lambda state: None
        self.states: list[wire.State] = []
        self.events: list[HostEvent] = []
        self.host.connect(0)

    def step(self, samples: int = 1) -> None:
        """Advance by samples; each goes to the host, and its answer back before the next."""
        for _ in range(samples):
            self.bench.receive(self.host.data_to_send())
            self._hear(self.bench.step())

    def _hear(self, data: bytes) -> None:
        for event in self.host.receive(data, self.bench.now_us) + self.host.tick(self.bench.now_us):
            self.events.append(event)
            if isinstance(event, StateReceived):
                self.states.append(event.state)
                setpoint = self.answer(event.state)
                if setpoint is not None and self.host.state is not HostState.SYNC:
                    self.host.send_setpoint(setpoint)

    def until(self, done: Callable[[], object], most: int = 2000) -> None:
        """Step until `done`."""
        for _ in range(most):
            if done():
                return
            self.step()
        raise AssertionError(f"not within {most} samples; last events {self.events[-5:]}")

    def of(self, kind: type[HostEvent]) -> list[HostEvent]:
        """Return the events of a kind so far."""
        return [event for event in self.events if isinstance(event, kind)]

    def request(self, message: wire.Message) -> wire.Message | None:
        """Ask and return the answer: the reply, the ERROR, or None if none came."""
        number = self.host.request(message, self.bench.now_us)

        def answered() -> list[HostEvent]:
            return [
                event
                for event in self.events
                if isinstance(event, RequestDone | RequestFailed) and event.id == number
            ]

        self.until(answered)
        (event,) = answered()
        return event.reply if isinstance(event, RequestDone) else event.error

    def connected(self) -> "Loop":
        """Step until the session is open and the board is SAFE."""
        self.until(lambda: self.of(Connected) and self.mode is BoardState.SAFE)
        return self

    def armed(self) -> "Loop":
        """Connect and arm."""
        self.connected()
        token = self.request(wire.ArmRequest(0, self.bench.board.parameters.crc))
        assert isinstance(token, wire.ArmToken), token
        if self.answer(self.states[-1]) is None:
            self.answer = hold(0)
        done = self.request(wire.ArmConfirm(0, token.token))
        assert isinstance(done, wire.Done), done
        self.until(lambda: self.mode is BoardState.ARMED, 20)
        return self

    @property
    def mode(self) -> BoardState:
        """Mode of the last STATE."""
        return self.states[-1].mode if self.states else BoardState.BOOT

    @property
    def reports(self) -> list[wire.FaultReport]:
        """Faults told so far."""
        return [event.report for event in self.of(FaultReported)]  # type: ignore[attr-defined]

    @property
    def restarts(self) -> int:
        """Restarts of the board noticed so far."""
        return len(self.of(BoardRestarted))

    @property
    def stats(self) -> list[wire.LinkStats]:
        """LINK_STATS so far."""
        return [event.stats for event in self.of(StatsReceived)]  # type: ignore[attr-defined]


def hold(x_mA: int, y_mA: int = 0, duty: tuple[int, int] = (0, 0), flags: int = 0) -> Answer:
    """Answer every STATE with the same setpoint."""
    return lambda state: wire.Setpoint(0, state.t_us, (x_mA, y_mA), duty, flags, 100)
