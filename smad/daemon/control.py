"""The control task: one step for each STATE, and what follows from the board's other messages.

Nothing here waits. The step is read → session → sample → controller → setpoint → write; what the
sample is worth to others (telemetry, run log) comes after the write, from a bounded queue.
"""

from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from firmware_protocol.enums import ValidBit
from firmware_protocol.events import BoardRestarted, HostEvent, HostState, StateReceived
from firmware_protocol.host import HostSession
from firmware_protocol.messages import Setpoint, State
from smad.config import LinkConfig
from smad.control.controller import Controller
from smad.control.cooling import PumpStarts
from smad.control.sample import BoardTime, Sample, Scales, sample_of
from smad.control.setpoint import Output, setpoint_of
from smad.daemon.histogram import Histogram
from smad.daemon.services import Clocks
from smad.daemon.trace import Trace
from smad.runlog.rows import row_of
from smad.runlog.schema import Row

_SETPOINT_VALID = int(ValidBit.SETPOINT)
_AT_REST = Output()
_QUEUE = 1000
"""Samples that wait to be published, at most."""


@dataclass
class StepCounts:
    """Totals of the control task."""

    samples: int = 0
    skipped: int = 0
    setpoints: int = 0
    setpoints_dropped: int = 0
    finished_dropped: int = 0


@dataclass(slots=True)
class Finished:
    """A sample with everything that came of it, for telemetry and run log."""

    sample: Sample
    state: State
    setpoint: Setpoint | None
    host_s: float
    reference_m: float
    reference_degC: float
    pump_starts: tuple[int, int]

    def row(self, degrees_per_mm: float) -> Row:
        """Return it as a row of the run log; a joint turns by so much for 1 mm."""
        return row_of(
            self.sample,
            self.state,
            self.setpoint,
            host_time_s=self.host_s,
            reference_m=self.reference_m,
            reference_degC=self.reference_degC,
            pump_starts=self.pump_starts,
            degrees_per_mm=degrees_per_mm,
        )


@dataclass(frozen=True)
class ControlOutputs:
    """Where the control task sends setpoints, events and samples.

    `write` says whether the port took the bytes; `on_event` gets what is not a sample;
    `on_finished` is called when a sample waits in `finished` to be published.
    """

    write: Callable[[bytes], bool]
    on_event: Callable[[HostEvent], None]
    on_finished: Callable[[], None]


class ControlTask:
    """Turns bytes into steps. Pure but for the clocks and the outputs that it is given.

    `stepping` off: session and samples go on, but nothing is computed or driven any more.
    """

    def __init__(
        self,
        session: HostSession,
        controller: Controller,
        config: LinkConfig,
        outputs: ControlOutputs,
        clocks: Clocks,
        *,
        trace: Trace | None = None,
    ) -> None:
        self.session = session
        self.controller = controller
        self.counts = StepCounts()
        self.own_share = Histogram()
        self.setpoint_age = Histogram()
        self.jitter = Histogram()
        self.finished: deque[Finished] = deque()
        self.last: Finished | None = None
        self.last_us = 0
        """When the last sample came, by the daemon's clock."""
        self.axis = config.axis
        self.scales = Scales({}, config.axis)
        self.stepping = True
        self.withheld = False
        """Send no setpoints: the board confirms no stop, so its own watchdog has to end heating."""
        self.fed_us = 0
        """When a setpoint was sent last."""
        self.on_next: Callable[[State], None] | None = None
        """Called once, with the next sample that is answered."""
        self._ttl_ms = config.setpoint_ttl_ms
        self._write = outputs.write
        self._on_event = outputs.on_event
        self._on_finished = outputs.on_finished
        self._clock_us = clocks.us
        self._wall_clock = clocks.wall_s
        self._stopwatch_ns = clocks.stopwatch_ns
        self._trace = trace
        self._time = BoardTime()
        self._pump_starts = PumpStarts()
        self._last_age_seq = -1
        self._arrived: tuple[int, int] | None = None

    def opened(self) -> None:
        """The port is open: begin the handshake."""
        self._arrived = None
        self.session.connect(self._clock_us())
        self.flush()

    def lost(self) -> None:
        """The port went away."""
        self._arrived = None
        for event in self.session.lost(self._clock_us()):
            self._on_event(event)

    def receive(self, data: bytes) -> None:
        """Take in bytes that were just read; step for the newest sample in them."""
        began_ns = self._stopwatch_ns()
        events = self.session.receive(data, self._clock_us())
        samples: list[StateReceived] = []
        other_events: list[HostEvent] = []
        for event in events:
            if type(event) is not StateReceived:
                other_events.append(event)
            else:
                samples.append(event)
        try:
            if self.stepping:
                if samples:
                    self._step(samples, began_ns)
            else:
                # Whoever waits for the board to be off has to see that it is.
                for received in samples:
                    self._pass_over(received)
        finally:
            # Also when the step dies: somebody may be waiting for the reply that came with it.
            self._pass_on(other_events)

    def _pass_on(self, events: list[HostEvent]) -> None:
        for other in events:
            if isinstance(other, BoardRestarted):
                self._arrived = None
                self._time.restart()
            self._on_event(other)
        self.flush()

    def clear_timing(self) -> None:
        """Forget the durations measured so far."""
        for histogram in (self.own_share, self.setpoint_age, self.jitter):
            histogram.clear()

    def tick(self) -> None:
        """Let the session repeat what was not answered; never needed for a step."""
        for event in self.session.tick(self._clock_us()):
            self._on_event(event)
        self.flush()

    def flush(self) -> bool:
        """Write what the session wants to say; False when the port did not take it."""
        data = self.session.data_to_send()
        return self._write(data) if data else True

    def _step(self, samples: list[StateReceived], began_ns: int) -> None:
        # The newest is answered first; the older ones are only worth recording.
        older: Sequence[StateReceived] = samples[:-1] if len(samples) > 1 else ()
        times_us = [self._time.since_first(received.board_us) for received in older]
        newest = samples[-1]
        state = newest.state
        sample = self._sample(state, self._time.since_first(newest.board_us))
        output = self.controller.step(sample)
        if not sample.armed:
            # Whatever the controller last wanted: a board that is not armed by us is asked nothing.
            output = _AT_REST
        setpoint = setpoint_of(output, t_ref_us=state.t_us, axis=self.axis, ttl_ms=self._ttl_ms)
        if not self.withheld:
            self._send(setpoint)
        took_ns = self._stopwatch_ns() - began_ns
        self.own_share.add(took_ns)
        if self._trace is not None:
            self._trace.add(began_ns, took_ns)
        for received, t_us in zip(older, times_us, strict=True):
            self.counts.skipped += 1
            self._finish(self._sample(received.state, t_us), received.state, None)
        self._observe(state, sample, began_ns)
        if (tell := self.on_next) is not None:
            self.on_next = None
            tell(state)
        self._finish(sample, state, setpoint)

    def _pass_over(self, received: StateReceived) -> None:
        t_us = self._time.since_first(received.board_us)
        self._finish(self._sample(received.state, t_us), received.state, None)

    def _send(self, setpoint: Setpoint) -> None:
        sent = self.session.stats.setpoints_sent
        self.session.send_setpoint(setpoint)
        if self.flush():
            self.counts.setpoints += 1
        else:
            self.counts.setpoints_dropped += 1
        if self.session.stats.setpoints_sent > sent:
            self.fed_us = self._clock_us()

    def _sample(self, state: State, t_us: int) -> Sample:
        armed = self.session.state is HostState.RUNNING
        return sample_of(state, t_us, self.scales, armed=armed)

    def _observe(self, state: State, sample: Sample, arrived_ns: int) -> None:
        if self._arrived is not None:
            before_ns, before_us = self._arrived
            board_ns = (sample.t_us - before_us) * 1000
            self.jitter.add(abs(arrived_ns - before_ns - board_ns))
        self._arrived = (arrived_ns, sample.t_us)
        # Each setpoint counts once, although the board repeats its age until the next one.
        if state.valid & _SETPOINT_VALID and state.sp_seq != self._last_age_seq:
            self._last_age_seq = state.sp_seq
            self.setpoint_age.add(state.sp_age_us * 1000)

    def _finish(self, sample: Sample, state: State, setpoint: Setpoint | None) -> None:
        self.counts.samples += 1
        controller = self.controller
        finished = Finished(
            sample,
            state,
            setpoint,
            self._wall_clock(),
            controller.reference_m,
            controller.target_degC,
            self._pump_starts.step(sample.pump_duty),
        )
        self.last, self.last_us = finished, self._clock_us()
        if len(self.finished) >= _QUEUE:
            self.counts.finished_dropped += 1
            return
        self.finished.append(finished)
        self._on_finished()
