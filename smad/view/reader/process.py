"""The reader process of the page's server, which is started when it is first needed.

Reading logs and making plans takes seconds of processor time. A click on STOP passes through the
server and must not wait for them, so another process does that work.
"""

import asyncio
import contextlib
import os
from collections.abc import Callable
from multiprocessing import get_context
from multiprocessing.connection import Connection
from multiprocessing.context import SpawnProcess
from typing import Any, ParamSpec, TypeVar

from smad.errors import SmadError, first_line
from smad.extras import missing
from smad.processes import oom
from smad.processes.parent import begin_worker

PATIENCE_S = 60.0
"""How long the page waits for an answer of the reader."""
NICER = 10
"""The daemon's loop comes first."""
P = ParamSpec("P")
T = TypeVar("T")


class ReaderError(SmadError):
    """The reader could not carry out a request."""


class ReaderProcess:
    """Lets functions of `smad.view.reader.work` be carried out there, one after the other."""

    def __init__(self) -> None:
        self._process: SpawnProcess | None = None
        self._pipe: Connection
        self._free = asyncio.Lock()

    async def ask(self, work: Callable[P, T], *arguments: P.args, **named: P.kwargs) -> T:
        """Return what `work` returns there. Raises ReaderError."""
        async with self._free:
            try:
                request = work, arguments, named
                async with asyncio.timeout(PATIENCE_S):
                    failed, result = await asyncio.to_thread(_answered, self._running(), request)
            except (OSError, EOFError, TimeoutError) as error:
                self.close()
                why = "it has ended" if isinstance(error, EOFError) else first_line(error)
                raise ReaderError(
                    f"the page's reader did not answer ({why})",
                    limit=f"{PATIENCE_S:g} s",
                    action="try again",
                ) from error
            except asyncio.CancelledError:
                # Its answer would be taken for that to the next request.
                self.close()
                raise
        if failed:
            raise ReaderError(failed)
        answer: T = result
        return answer

    def _running(self) -> Connection:
        """The pipe to the process, begun where it does not run."""
        if self._process is None or not self._process.is_alive():
            context = get_context("spawn")
            self._pipe, end = context.Pipe()
            self._process = context.Process(target=_serve, args=(end, os.getpid()), daemon=True)
            self._process.start()
            # Once the process has ended nobody has this end, and nothing is waited for.
            end.close()
        return self._pipe

    def close(self) -> None:
        """End the process, if it runs."""
        process, self._process = self._process, None
        if process is not None:
            process.kill()
            process.join()


def _answered(pipe: Connection, request: Any) -> tuple[str, Any]:
    """What failed, if anything did, and what was asked for."""
    pipe.send(request)
    answer: tuple[str, Any] = pipe.recv()
    return answer


def _serve(pipe: Connection, server: int) -> None:
    """Carry out requests until the server ends."""
    begin_worker(server)
    oom.prefer_as_oom_victim()
    os.nice(NICER)
    with contextlib.suppress(EOFError):
        while True:
            work, arguments, named = pipe.recv()
            try:
                answer = "", work(*arguments, **named)
            except Exception as error:
                # A damaged file is reported to the page; the next request is carried out.
                absent = missing(error) if isinstance(error, ModuleNotFoundError) else None
                answer = str(absent or error), None
            pipe.send(answer)
