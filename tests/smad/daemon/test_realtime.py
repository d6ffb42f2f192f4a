"""The real-time measures: taken where granted, reported where not, never an error."""

import gc
import json
import os
import subprocess
import sys
from collections.abc import Iterator
from typing import Any

import pytest

from smad.daemon.realtime import IdleCollector
from smad.daemon.sockets.descriptors import RESERVE, Descriptors

TAKE = """
import json, os, sys
import msgspec
from smad.config import RealtimeConfig
from smad.daemon import realtime
from smad.daemon.sockets.descriptors import Descriptors
if {drop} and os.getuid() == 0:
    import resource
    resource.setrlimit(resource.RLIMIT_MEMLOCK, (65536, 65536))
    os.setgid(65534)
    os.setuid(65534)
Descriptors().set_reserve_aside()
config = msgspec.convert({config!r}, RealtimeConfig)
taken = realtime.take(config)
print(json.dumps([[m.name, m.asked, m.granted, m.detail] for m in taken.measures]))
print(os.sched_getscheduler(0) == os.SCHED_FIFO)
taken.close()
"""


def taken(config: dict[str, Any], *, drop: bool = False) -> tuple[dict[str, Any], bool]:
    """Take the measures in a process of their own; return them by name, and whether it is FIFO."""
    done = subprocess.run(
        [sys.executable, "-c", TAKE.format(drop=drop, config=config)],
        capture_output=True,
        text=True,
        check=True,
    )
    measures, fifo = done.stdout.strip().splitlines()
    return {name: rest for name, *rest in json.loads(measures)}, fifo == "True"


def test_each_measure_says_whether_it_is_in_force() -> None:
    measures, fifo = taken({"fifo_priority": 10, "timer_slack_ns": 1})
    asked, granted, detail = measures["SCHED_FIFO"]
    assert asked
    assert granted == fifo
    assert ("priority 10" in detail) if granted else ("CAP_SYS_NICE" in detail)
    assert measures["timer slack"][1:] == [True, "1 ns"]
    assert measures["garbage collector frozen"][1] is True


@pytest.mark.skipif(os.getuid() != 0, reason="only root can drop its rights")
def test_what_an_ordinary_user_is_refused_is_named_with_what_grants_it() -> None:
    measures, fifo = taken({"hold_cpu_latency": True}, drop=True)
    assert not fifo
    assert "CAP_SYS_NICE" in measures["SCHED_FIFO"][2]
    assert "LimitMEMLOCK" in measures["locked memory"][2]
    assert "/dev/cpu_dma_latency" in measures["processor kept awake"][2]


def test_what_is_not_asked_for_is_not_taken() -> None:
    config = {"fifo_priority": 0, "lock_memory": False, "freeze_gc": False}
    measures, fifo = taken(config)
    assert not fifo
    for name in ("SCHED_FIFO", "locked memory", "garbage collector frozen"):
        asked, granted, _ = measures[name]
        assert (asked, granted) == (False, False)


def test_the_reserve_of_descriptors_stays_set_aside() -> None:
    measures, _ = taken({"fifo_priority": 0, "lock_memory": False})
    assert measures["open files"][1:] == [True, f"limit {Descriptors().limit - RESERVE}"]


class Clock:
    """Time that passes only when told to, and a little with each look."""

    def __init__(self) -> None:
        self.now_ns = 0

    def __call__(self) -> int:
        self.now_ns += 1000
        return self.now_ns


@pytest.fixture
def quiet_collector() -> Iterator[None]:
    gc.collect()
    gc.disable()
    yield
    gc.enable()


def garbage(count: int) -> list[list[int]]:
    """Objects that the collector looks at."""
    return [[number] for number in range(count)]


@pytest.mark.usefixtures("quiet_collector")
def test_garbage_is_collected_only_when_there_is_some() -> None:
    collector = IdleCollector(True, Clock())
    collector.run(10**9, at_rest=True)
    assert collector.collections == 0
    kept = garbage(IdleCollector.YOUNG_OBJECTS + 500)
    collector.run(10**9, at_rest=True)
    assert collector.collections == 1
    assert len(kept) > 0


@pytest.mark.usefixtures("quiet_collector")
def test_the_whole_heap_is_collected_while_armed_only_if_the_last_time_fits_twice() -> None:
    clock = Clock()
    collector = IdleCollector(True, clock)
    clock.now_ns += IdleCollector.FULL_EVERY_NS + 1
    kept = [garbage(2000)]
    collector.run(10**9, at_rest=True)
    cost_ns = 1000
    full_before = gc.get_stats()[2]["collections"]
    clock.now_ns += IdleCollector.FULL_EVERY_NS + 1
    kept.append(garbage(2000))
    collector.run(cost_ns, at_rest=False)
    assert gc.get_stats()[2]["collections"] == full_before
    kept.append(garbage(2000))
    collector.run(3 * cost_ns, at_rest=False)
    assert gc.get_stats()[2]["collections"] == full_before + 1


@pytest.mark.usefixtures("quiet_collector")
def test_a_collector_that_is_switched_off_does_nothing() -> None:
    collector = IdleCollector(False, Clock())
    kept = garbage(5000)
    collector.run(10**9, at_rest=True)
    assert collector.collections == 0
    assert kept


THREADS = """
import os, threading
from smad.config import RealtimeConfig
from smad.daemon import realtime
def priority(): return (os.sched_getscheduler(0), os.sched_getparam(0).sched_priority)
seen, go = {}, threading.Event()
def early():
    go.wait()
    seen["early"] = priority()
def late():
    realtime.step_below_loop()
    seen["late"] = priority()
first = threading.Thread(target=early)
first.start()
realtime.take(RealtimeConfig(fifo_priority=20, lock_memory=False))
second = threading.Thread(target=late)
second.start()
go.set()
first.join(), second.join()
print(priority() == (os.SCHED_FIFO, 20), seen["early"] == seen["late"] == (os.SCHED_FIFO, 19))
"""


def test_other_threads_run_one_step_below_the_loop_never_at_ordinary_priority() -> None:
    if not taken({"fifo_priority": 10})[1]:
        pytest.skip("real-time priority is not granted here")
    done = subprocess.run(
        [sys.executable, "-c", THREADS], capture_output=True, text=True, check=True
    )
    assert done.stdout.strip() == "True True"
