"""What makes the loop steady: each measure is asked for, taken where granted, and reported.

A Python thread at ordinary priority that is suspended while it holds the interpreter would hold up
the loop, whatever the loop's priority. So the daemon's other Python threads get real-time priority
too, one step below; those that it starts later inherit it. ZeroMQ's own thread, which never holds
the interpreter, stays ordinary: it is started before.
"""

import contextlib
import ctypes
import ctypes.util
import gc
import os
import resource
import struct
import sys
import threading
import time
from collections.abc import Callable

from smad.api import Measure
from smad.config import RealtimeConfig
from smad.processes import oom

_PR_SET_TIMERSLACK = 29
_PR_GET_TIMERSLACK = 30
_MCL_CURRENT = 1
_MCL_FUTURE = 2
_DMA_LATENCY = "/dev/cpu_dma_latency"
_RT_RUNTIME = "/proc/sys/kernel/sched_rt_runtime_us"
_SWITCH_INTERVAL_S = 2e-5


class Realtime:
    """The measures in force. `close()` gives back the one that holds a file open."""

    def __init__(self, measures: tuple[Measure, ...], latency_fd: int | None) -> None:
        self.measures = measures
        self._latency_fd = latency_fd

    @property
    def missing(self) -> tuple[Measure, ...]:
        """The measures that were asked for and refused."""
        return tuple(m for m in self.measures if m.asked and not m.granted)

    def close(self) -> None:
        """Let the processor sleep again."""
        if self._latency_fd is not None:
            os.close(self._latency_fd)
            self._latency_fd = None


def take(config: RealtimeConfig) -> Realtime:
    """Ask for every measure of the configuration; never raises, whatever is refused.

    Called by the thread that runs the loop, after everything is imported and connected: locking
    the memory takes tens of milliseconds, and frozen objects are never looked at again.
    """
    libc = ctypes.CDLL(None, use_errno=True)
    latency_fd, latency = _hold_cpu_latency(config.hold_cpu_latency)
    measures = (
        _lock_memory(libc, config.lock_memory),
        _timer_slack(libc, config.timer_slack_ns),
        latency,
        _open_files(),
        _switch_interval(),
        _freeze_gc(config.freeze_gc),
        _survival(),
        _fifo(config.fifo_priority),
    )
    return Realtime(measures, latency_fd)


def _fifo(priority: int) -> Measure:
    name = "SCHED_FIFO"
    if priority == 0:
        return Measure(name, False, False, "ordinary scheduling, as configured")
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(priority))
    except OSError as error:
        return Measure(
            name,
            True,
            False,
            f"refused ({error.strerror}): needs CAP_SYS_NICE or an rtprio limit of {priority}; "
            "smad docs install/systemd grants it",
        )
    for thread in threading.enumerate():
        if thread is not threading.current_thread() and thread.native_id is not None:
            with contextlib.suppress(OSError):
                _step_below(thread.native_id, priority)
    return Measure(name, True, True, f"priority {priority}{_throttle()}")


def step_below_loop() -> None:
    """Put the calling thread, if it inherited the loop's real-time priority, one step below it."""
    if os.sched_getscheduler(0) == os.SCHED_FIFO:
        _step_below(0, os.sched_getparam(0).sched_priority)


def _step_below(thread: int, priority: int) -> None:
    os.sched_setscheduler(thread, os.SCHED_FIFO, os.sched_param(max(1, priority - 1)))


def _switch_interval() -> Measure:
    # How long another Python thread may keep the interpreter once the loop asks for it.
    sys.setswitchinterval(_SWITCH_INTERVAL_S)
    return Measure("thread switch interval", True, True, f"{_SWITCH_INTERVAL_S * 1e3:g} ms")


def _throttle() -> str:
    try:
        with open(_RT_RUNTIME) as file:
            runtime_us = int(file.read())
    except (OSError, ValueError):
        return ""
    return "" if runtime_us < 0 else f", at most {runtime_us / 10_000:.0f} % of a core"


def _lock_memory(libc: ctypes.CDLL, wanted: bool) -> Measure:
    name = "locked memory"
    if not wanted:
        return Measure(name, False, False, "not asked for")
    if libc.mlockall(_MCL_CURRENT | _MCL_FUTURE) != 0:
        limit, _ = resource.getrlimit(resource.RLIMIT_MEMLOCK)
        reason = os.strerror(ctypes.get_errno())
        return Measure(
            name,
            True,
            False,
            f"refused ({reason}): memlock limit is {limit // 1024} KiB; "
            "needs CAP_IPC_LOCK or LimitMEMLOCK=infinity",
        )
    return Measure(name, True, True, "all pages, present and future")


def _timer_slack(libc: ctypes.CDLL, slack_ns: int) -> Measure:
    name = "timer slack"
    libc.prctl(_PR_SET_TIMERSLACK, ctypes.c_ulong(slack_ns), 0, 0, 0)
    got_ns = libc.prctl(_PR_GET_TIMERSLACK, 0, 0, 0, 0)
    return Measure(name, True, got_ns == slack_ns, f"{got_ns} ns")


def _hold_cpu_latency(wanted: bool) -> tuple[int | None, Measure]:
    name = "processor kept awake"
    if not wanted:
        return None, Measure(name, False, False, "not asked for")
    try:
        fd = os.open(_DMA_LATENCY, os.O_WRONLY | os.O_CLOEXEC)
        os.write(fd, struct.pack("i", 0))
    except OSError as error:
        return None, Measure(
            name, True, False, f"refused ({error.strerror}): {_DMA_LATENCY} needs write permission"
        )
    return fd, Measure(name, True, True, f"{_DMA_LATENCY} held at 0")


def _open_files() -> Measure:
    # `Descriptors` has raised it already, less its reserve.
    limit, _ = resource.getrlimit(resource.RLIMIT_NOFILE)
    return Measure("open files", True, True, f"limit {limit}")


def _survival() -> Measure:
    name = "ended last when memory runs out"
    before = oom.score()
    now = oom.protect()
    if now is None:
        return Measure(name, False, False, "this system has no oom_score_adj")
    granted = now <= oom.LAST
    # Quietly: a daemon that is started by hand is never granted it, and needs no line about it.
    asked = granted or (before is not None and before < 0)
    score = f"oom_score_adj {now}"
    return Measure(
        name, asked, granted, score if granted else f"{score}; OOMScoreAdjust= in systemd grants it"
    )


def _freeze_gc(wanted: bool) -> Measure:
    name = "garbage collector frozen"
    if not wanted:
        return Measure(name, False, False, "not asked for")
    gc.collect()
    gc.freeze()
    gc.disable()
    return Measure(name, True, True, f"{gc.get_freeze_count()} objects; collects in idle time")


class IdleCollector:
    """Collects garbage between two samples, only where it fits.

    `run(spare_ns)` is called after a step, when nothing is due for `spare_ns`. The youngest
    generation goes first and often; the whole heap only when the last such collection, doubled,
    fits into the spare time, or while the bench is at rest.
    """

    YOUNG_OBJECTS = 1_000
    FULL_EVERY_NS = 10_000_000_000

    def __init__(self, enabled: bool, clock_ns: Callable[[], int] = time.perf_counter_ns) -> None:
        self.enabled = enabled
        self.collections = 0
        self._clock_ns = clock_ns
        self._full_cost_ns = 0
        self._last_full_ns = clock_ns()

    def run(self, spare_ns: int, *, at_rest: bool) -> None:
        """Collect what is due and fits."""
        if not self.enabled or gc.get_count()[0] < self.YOUNG_OBJECTS:
            return
        start_ns = self._clock_ns()
        full = start_ns - self._last_full_ns > self.FULL_EVERY_NS and (
            at_rest or 2 * self._full_cost_ns < spare_ns
        )
        gc.collect(2 if full else 1)
        took_ns = self._clock_ns() - start_ns
        self.collections += 1
        if full:
            self._last_full_ns = start_ns
            self._full_cost_ns = took_ns
