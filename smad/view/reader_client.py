"""The server's client of its reader process, which is started when it is first needed."""

import asyncio
import contextlib
import sys
from asyncio.subprocess import PIPE, Process
from typing import TypeVar

import msgspec
from msgspec import Struct

from smad.errors import SmadError
from smad.view.requests import ReaderRequest

PATIENCE_S = 60.0
LARGEST_ANSWER = 64 * 2**20
T = TypeVar("T")


class ReaderError(SmadError):
    """The reader could not carry out a request."""


class _Answer(Struct):
    done: msgspec.Raw = msgspec.Raw()
    failed: str = ""


class ReaderClient:
    """Sends requests to the reader process, one after the other."""

    def __init__(self) -> None:
        self._process: Process | None = None
        self._free = asyncio.Lock()

    async def ask(self, request: ReaderRequest, kind: type[T]) -> T:
        """Return the reply to a request. Raises ReaderError."""
        async with self._free:
            try:
                line = await asyncio.wait_for(self._answer(request), PATIENCE_S)
            except (OSError, ValueError, TimeoutError) as error:
                await self.close()
                raise ReaderError(
                    f"the page's reader did not answer ({error or type(error).__name__})",
                    limit=f"{PATIENCE_S:g} s",
                    action="try again",
                ) from error
            except asyncio.CancelledError:
                # Its answer would be taken for that to the next request.
                await self.close()
                raise
        answer = msgspec.json.decode(line, type=_Answer)
        if answer.failed:
            raise ReaderError(answer.failed)
        return msgspec.json.decode(answer.done, type=kind)

    async def _answer(self, request: ReaderRequest) -> bytes:
        if self._process is None or self._process.returncode is not None:
            self._process = await asyncio.create_subprocess_exec(
                sys.executable,
                "-m",
                "smad.view.reader",
                stdin=PIPE,
                stdout=PIPE,
                limit=LARGEST_ANSWER,
            )
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._process.stdin.write(msgspec.json.encode(request) + b"\n")
        line = await self._process.stdout.readline()
        if not line:
            raise OSError("it has ended")
        return line

    async def close(self) -> None:
        """End the process, if it runs."""
        process, self._process = self._process, None
        if process is not None:
            with contextlib.suppress(ProcessLookupError):
                process.kill()
            await process.wait()
