"""Tasks that are to end for certain."""

import asyncio

AGAIN_S = 1.0


async def cancel_and_wait(*tasks: asyncio.Task[None]) -> None:
    """Cancel tasks until they have ended.

    A cancellation that comes together with a time-out, or with what is waited for, may be lost on
    the way, and a loop around it would go on for ever.
    """
    while pending := [task for task in tasks if not task.done()]:
        for task in pending:
            task.cancel()
        await asyncio.wait(pending, timeout=AGAIN_S)
