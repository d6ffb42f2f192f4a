"""The daemon as a child process, for the demo, the benchmark and the tests."""

import contextlib
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path

from smad.client.endpoints import FOLDER_VARIABLE, read_connection
from smad.errors import DaemonError
from smad.processes.starting import STALLED_S, StallDetector

END_DEADLINE_S = 30.0
_POLL_S = 0.02
SMAD = ("-m", "smad")
"""What the interpreter runs: the program itself."""

_WITH_LIMIT = ("/bin/sh", "-c", 'ulimit -n "$0" && exec "$@"')


class DaemonProcess:
    """A running `smad start`. `folder` holds its sockets, `log` what it says.

    `descriptors` is its limit on open files. `program` stands in for `python -m smad`.
    """

    def __init__(
        self,
        arguments: Sequence[str],
        folder: Path,
        *,
        bench: str = "bench",
        environment: Mapping[str, str] | None = None,
        pass_fds: Sequence[int] = (),
        descriptors: int | None = None,
        program: Sequence[str] = SMAD,
    ) -> None:
        self.folder = folder
        self.bench = bench
        self.log = folder / f"{bench}.log"
        self.killed = False
        limited = [] if descriptors is None else [*_WITH_LIMIT, str(descriptors)]
        with self.log.open("ab") as output:
            self.process = subprocess.Popen(
                [*limited, sys.executable, *program, "start", "--bench", bench, *arguments],
                stdin=subprocess.DEVNULL,
                stdout=output,
                stderr=output,
                env={**os.environ, **(environment or {}), FOLDER_VARIABLE: str(folder)},
                # ctrl-C is for whoever started us; they end the daemon in an orderly way.
                start_new_session=True,
                pass_fds=tuple(pass_fds),
            )

    @property
    def last_line(self) -> str:
        """The last thing it said."""
        lines = self.log.read_text(errors="replace").strip().splitlines()
        return lines[-1] if lines else ""

    def wait_until_ready(self, waiting: Callable[[], None] = lambda: None) -> None:
        """Return once it answers commands.

        Raises DaemonError with its last line if it ends, or does nothing for STALLED_S.
        """
        stall = StallDetector(self.process.pid)
        while not stall.stalled():
            if read_connection(self.folder / f"{self.bench}.json") is not None:
                return
            if self.process.poll() is not None:
                break
            waiting()
            time.sleep(_POLL_S)
        else:
            self.end()
        last = self.last_line.removeprefix("smad: ") or f"it did nothing for {STALLED_S:g} s"
        raise DaemonError(f"the daemon did not start: {last}", action=f"see {self.log}")

    def end(self, number: int = signal.SIGINT) -> int:
        """Send a signal, wait for the end, return the exit status.

        Afterwards `killed` says whether it had to be killed, END_DEADLINE_S later.
        """
        if self.process.poll() is None:
            self.process.send_signal(number)
        try:
            return self.process.wait(END_DEADLINE_S)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.killed = True
            return self.process.wait()


@contextlib.contextmanager
def running_daemon(
    arguments: Sequence[str],
    folder: Path,
    *,
    bench: str = "bench",
    waiting: Callable[[], None] = lambda: None,
) -> Iterator[DaemonProcess]:
    """Run a daemon for as long as the block lasts.

    Raises DaemonError when it does not come up, or does not end by itself.
    """
    daemon = DaemonProcess(arguments, folder, bench=bench)
    try:
        daemon.wait_until_ready(waiting)
        yield daemon
    finally:
        daemon.end()
    if daemon.killed:
        raise DaemonError(
            "the daemon did not end by itself and was killed; the end of its run log may be lost",
            value=f"{END_DEADLINE_S:g} s after the signal",
            action="recover the run log (smad log recover), and report this",
        )
