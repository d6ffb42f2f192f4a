"""The control task: one step for each STATE, and what follows from the board's other messages.

Nothing here waits. The step is read → session → sample → controller → setpoint → write; what the
sample is worth to others (telemetry, run log) comes after the write, from a bounded queue.
"""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass

from firmware_protocol.enums import ValidBit
from firmware_protocol.events import BoardRestarted, HostEvent, HostState, StateReceived
from firmware_protocol.host import HostSession
from firmware_protocol.messages import Setpoint, State
from smad.control.controller import Controller, Output
from smad.control.sample import BoardTime, Sample, Scales, sample_of
from smad.control.setpoint import setpoint_of
from smad.daemon.histogram import Histogram
from smad.daemon.trace import Trace

_SETPOINT_VALID = int(ValidBit.SETPOINT)
_TICKS = 0xFFFF
_WRAP = 0xFFFF_FFFF
_LARGEST_GAP = 0x8000
_AT_REST = Output()


@dataclass
class StepCounts:
    """Totals of the control task."""

    samples: int = 0
    missed: int = 0
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


class ControlTask:
    """Turns bytes into steps. Pure but for the clocks and the `write` that it is given.

    `stepping` off: the session goes on, but nothing is computed or driven any more.
    `on_event` gets what is not a sample; `on_finished` is called when a sample waits in
    `finished` to be published.
    """

    def __init__(
        self,
        session: HostSession,
        controller: Controller,
        *,
        axis: int,
        ttl_ms: int,
        write: Callable[[bytes], bool],
        on_event: Callable[[HostEvent], None],
        on_finished: Callable[[], None],
        clock_us: Callable[[], int],
        wall_clock: Callable[[], float] = time.time,
        stopwatch_ns: Callable[[], int] = time.perf_counter_ns,
        queue: int = 1000,
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
        self.scales = Scales({}, axis)
        self.stepping = True
        self._axis = axis
        self._ttl_ms = ttl_ms
        self._write = write
        self._on_event = on_event
        self._on_finished = on_finished
        self._clock_us = clock_us
        self._wall_clock = wall_clock
        self._stopwatch_ns = stopwatch_ns
        self._queue = queue
        self._trace = trace
        self._time = BoardTime()
        self._last_tick: int | None = None
        self._last_age_seq = -1
        self._arrived: tuple[int, int] | None = None

    @property
    def armed(self) -> bool:
        """Whether the board is armed, and by us."""
        return self.last is not None and self.last.sample.armed

    def opened(self) -> None:
        """The port is open: begin the handshake."""
        self._forget()
        self.session.connect(self._clock_us())
        self.flush()

    def lost(self) -> None:
        """The port went away."""
        self._forget()
        for event in self.session.lost(self._clock_us()):
            self._on_event(event)

    def receive(self, data: bytes) -> None:
        """Take in bytes that were just read; step for the newest sample in them."""
        began_ns = self._stopwatch_ns()
        events = self.session.receive(data, self._clock_us())
        states: list[State] = []
        others: list[HostEvent] = []
        for event in events:
            if type(event) is not StateReceived:
                others.append(event)
            elif event.state.axis == self._axis:
                states.append(event.state)
        try:
            if states and self.stepping:
                self._step(states, began_ns)
        finally:
            # Also when the step dies: somebody may be waiting for the reply that came with it.
            self._pass_on(others)

    def _pass_on(self, others: list[HostEvent]) -> None:
        for other in others:
            if isinstance(other, BoardRestarted):
                # Its counter begins anew: the samples between are none that were missed.
                self._forget()
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

    def _step(self, states: list[State], began_ns: int) -> None:
        # The newest is answered first; the older ones are only worth recording.
        state = states[-1]
        sample = self._sample(state, self._time.unwrap(state.t_us))
        output = self.controller.step(sample)
        if not sample.armed:
            # Whatever the controller last wanted: a board that is not armed by us is asked nothing.
            output = _AT_REST
        setpoint = setpoint_of(output, t_ref_us=state.t_us, axis=self._axis, ttl_ms=self._ttl_ms)
        self.session.send_setpoint(setpoint)
        if self.flush():
            self.counts.setpoints += 1
        else:
            self.counts.setpoints_dropped += 1
        took_ns = self._stopwatch_ns() - began_ns
        self.own_share.add(took_ns)
        if self._trace is not None:
            self._trace.add(began_ns, took_ns)
        for older in states[:-1]:
            self.counts.skipped += 1
            t_us = sample.t_us - ((state.t_us - older.t_us) & _WRAP)
            self._finish(self._sample(older, t_us), older, None)
        self._observe(state, sample, began_ns)
        self._finish(sample, state, setpoint)

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

    def _count(self, state: State) -> None:
        counts = self.counts
        counts.samples += 1
        if self._last_tick is not None:
            gap = (state.tick - self._last_tick - 1) & _TICKS
            if gap < _LARGEST_GAP:
                counts.missed += gap
        self._last_tick = state.tick

    def _finish(self, sample: Sample, state: State, setpoint: Setpoint | None) -> None:
        self._count(state)
        controller = self.controller
        finished = Finished(
            sample,
            state,
            setpoint,
            self._wall_clock(),
            controller.reference_m,
            controller.target_degC,
        )
        self.last = finished
        if len(self.finished) >= self._queue:
            self.counts.finished_dropped += 1
            return
        self.finished.append(finished)
        self._on_finished()

    def _forget(self) -> None:
        self._last_tick = None
        self._arrived = None
