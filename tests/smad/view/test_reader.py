"""The process that reads logs for the page's server."""

import asyncio
import os
import signal
import time

import pytest

from smad.view.reader import work
from smad.view.reader.process import ReaderError, ReaderProcess


async def test_what_fails_is_told_and_the_next_request_is_carried_out() -> None:
    reader = ReaderProcess()
    try:
        with pytest.raises(ReaderError, match="there is no such experiment"):
            await reader.ask(work.plans, "fig99", {}, None, 0.0)  # type: ignore[arg-type]
        assert await reader.ask(os.getpid) != os.getpid()
    finally:
        reader.close()


async def test_a_process_that_was_killed_is_told_and_begun_again() -> None:
    reader = ReaderProcess()
    try:
        before = await reader.ask(os.getpid)
        with pytest.raises(ReaderError, match=r"did not answer \(it has ended\)"):
            await reader.ask(os.kill, before, signal.SIGKILL)
        assert await reader.ask(os.getpid) != before
    finally:
        reader.close()


async def test_a_request_that_is_given_up_leaves_no_answer_to_the_next() -> None:
    reader = ReaderProcess()
    try:
        given_up = asyncio.create_task(reader.ask(time.sleep, 1000.0))
        await asyncio.sleep(0)
        given_up.cancel()
        with pytest.raises(asyncio.CancelledError):
            await given_up
        assert await reader.ask(os.getpid) > 0
    finally:
        reader.close()
