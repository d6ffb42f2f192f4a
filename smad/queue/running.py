"""A queue with the one runner that it may have, the bench that it watches, and its lock."""

import functools
import time
from collections.abc import Callable

from smad.progress import Say
from smad.queue.bench import BenchWatch
from smad.queue.lease import RunnerLease
from smad.queue.machine import Obstacle
from smad.queue.process import begin_item
from smad.queue.queue import Queue
from smad.queue.runner import Runner, RunnerParts
from smad.queue.states import Item
from smad.queue.words import clock, state_in_words


def run_queue(
    opened: Queue, *, check: Callable[[Item], Obstacle | None], say: Say, until_paused: bool
) -> None:
    """Carry a queue out, for ever or until it pauses. Raises QueueError where another does.

    `say` is told what happens, and when.
    """

    def stamped(text: str) -> None:
        say(f"{clock(time.time())}  {text}")

    lease = RunnerLease(opened.folder)
    lease.acquire()
    watch = BenchWatch(opened.bench, clock_s=time.monotonic)
    start = functools.partial(
        begin_item,
        folder=opened.folder.resolve(),
        bench=opened.bench,
        descriptor=lease.descriptor,
    )
    runner = Runner(opened.store, RunnerParts(watch=watch, start=start, check=check, say=stamped))
    try:
        runner.begin()
        stamped(f"runner of {opened.folder}: {state_in_words(opened.snapshot(), runner=True)}")
        runner.run(until_paused=until_paused)
    finally:
        runner.close()
        watch.close()
        lease.release()
