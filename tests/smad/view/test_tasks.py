"""The end of tasks of the live page."""

import asyncio
from collections.abc import Awaitable, Callable

import pytest

from smad.view import tasks


async def _loses_one() -> None:
    lost = False
    while True:
        try:
            await asyncio.sleep(3600.0)
        except asyncio.CancelledError:
            if lost:
                raise
            lost = True


async def _ends() -> None:
    await asyncio.sleep(0.0)


async def _fails() -> None:
    raise ConnectionError("the page is gone")


@pytest.mark.parametrize("work", [_loses_one, _ends, _fails])
def test_a_task_is_cancelled_until_it_has_ended(
    work: Callable[[], Awaitable[None]], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(tasks, "AGAIN_S", 0.001)

    async def ended() -> bool:
        task = asyncio.ensure_future(work())
        await asyncio.sleep(0.0)
        await tasks.cancel_and_wait(task)
        if not task.cancelled():
            task.exception()
        return task.done()

    assert asyncio.run(ended())
