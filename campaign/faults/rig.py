"""One fault of the process campaign: a watched bench behind a pseudo-terminal, and its daemon."""

from __future__ import annotations

import contextlib
import gc
import os
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import zmq

from campaign.faults.smalldisk import SmallDisk
from campaign.faults.trace import HOT, WatchedBench
from campaign.rig import BAUD, PATIENCE_S, POLL_S, DaemonRig, rig_config, start_daemon, tcp_config
from sim_device.faults import injection
from sim_device.ports import PortCounts, PtyPort
from sim_device.pty import Server
from smad.client import Client
from smad.config import DaemonConfig, LinkConfig, RecorderConfig
from smad.control.commands import DriveCurrent
from smad.processes.daemon import SMAD
from smad.runlog.reader import read_run

_FULL_A = 4.0
_FLOWING_mA = 3500
_HEATED_S = 1.0
_FLUSHED_WITHIN_S = 1.0
"""Four times the recorder's flush interval: a row this old must be in the file."""
_FLUSHED_LATE_S = 15.0
"""How much later on a machine that holds the recorder up."""


class FaultRig(DaemonRig):
    """The bench heats spring X with 4 A under the daemon's command once `heat` returns.

    With a `part`, that part of the daemon breaks on SIGUSR1 (`breakable_daemon`). With a limit on
    `descriptors`, the daemon listens on TCP as well. `paced`: the armed board waits for its daemon,
    so that a busy machine makes it slower and stops nothing.
    """

    def __init__(
        self,
        folder: Path,
        seed: int,
        part: str = "",
        disk: SmallDisk | None = None,
        descriptors: int | None = None,
        *,
        paced: bool = False,
    ) -> None:
        _look_through_what_is_left()
        self.bench = WatchedBench(seed=seed)
        self.disk = disk
        self.runs = folder / "runs" if disk is None else disk.folder
        port, counts = folder / "device.tty", PortCounts()
        self._server = Server(
            self.bench,
            lambda: PtyPort(port, counts),
            paced_by_host=paced,
            host_timeout_s=PATIENCE_S if paced else None,
        )
        self._thread = threading.Thread(target=self._server.run, name="bench", daemon=True)
        self._thread.start()
        key = zmq.curve_keypair()[0].decode()
        config = rig_config(
            folder,
            str(port),
            link=LinkConfig(port=str(port), baud=BAUD, reconnect_interval_s=0.1),
            recorder=RecorderConfig(folder=str(self.runs)),
            daemon=DaemonConfig() if descriptors is None else DaemonConfig(tcp=tcp_config(key)),
        )
        program = ("-m", "campaign.faults.breakable_daemon", part) if part else SMAD
        super().__init__(
            folder, start_daemon(folder, config, program=program, descriptors=descriptors)
        )
        self.onset_us = 0
        """Bench time from which on the oracle judges; a fault with several tries moves it."""
        self.programs: list[subprocess.Popen[str]] = []
        self.log: Path | None = None
        self.flushed_rows = 0

    def heat(self) -> Client:
        """Arm, heat with 4 A, wait until rows of it are flushed. Raises SmadError."""
        client = self.ready()
        self.arm()
        client.current(DriveCurrent(i_x_A=_FULL_A))
        self._until_heated(client)
        return client

    def heat_by_program(self, kind: str) -> Client:
        """Let a program of this kind arm and heat; the client returned only watches."""
        client = self.ready()
        self.program(kind)
        self._until_heated(client)
        return client

    def ready(self) -> Client:
        """A client of the daemon once it lets the bench be armed. Raises SmadError."""
        client = self.connect()
        self.wait("the link is up", lambda: client.status().link.state == "monitor")
        return client

    def program(self, kind: str, *more: str) -> subprocess.Popen[str]:
        """Begin a program of `campaign.faults.program`; it is killed with the rig at the latest."""
        words = ["-m", "campaign.faults.program", str(self.folder), kind, *more]
        program = subprocess.Popen([sys.executable, *words], stdout=subprocess.PIPE, text=True)
        self.programs.append(program)
        return program

    def _until_heated(self, client: Client) -> None:
        self.wait("4 A flow", self._flowing)
        time.sleep(_HEATED_S)
        recorder = client.status().recorder
        log, rows = Path(recorder.path), recorder.rows
        time.sleep(_FLUSHED_WITHIN_S)
        # A recorder that the machine holds up is later than it should be.
        self.wait("the rows are in the file", lambda: len(read_run(log)) >= rows, _FLUSHED_LATE_S)
        self.log, self.flushed_rows = log, rows

    def _flowing(self) -> bool:
        return self.bench.board.outputs.applied_mA[0] > _FLOWING_mA

    def watch(self, seconds: float, after_stop_s: float) -> None:
        """Let wall time pass, until some time after the bench stopped or at most `seconds`."""
        deadline = time.monotonic() + seconds
        while time.monotonic() < deadline:
            if self.bench.board.state not in HOT:
                time.sleep(after_stop_s)
                return
            time.sleep(POLL_S)

    def inject(self, name: str, **parameters: float) -> None:
        """Break something of the device with the next sample."""
        self.bench.arriving.append(injection(name, 0.0, **parameters))

    def signal(self, number: int) -> None:
        """Send a signal to the daemon."""
        os.kill(self.daemon.process.pid, number)

    def stop_bench(self) -> None:
        """End the bench's thread; its trace does not change any more."""
        self._server.stop()
        self._thread.join(PATIENCE_S)

    def close(self) -> None:
        """End the programs, the daemon and the bench."""
        for program in self.programs:
            program.kill()
            program.communicate()
        super().close()
        self.stop_bench()
        self._server.close()


def _look_through_what_is_left() -> None:
    """Have the collector look through what this process holds now, and never again.

    The bench is a thread of it. After an hour of tests the collector takes 0.3 s of processor time
    for all they left, on a busy machine two seconds, in which the bench does not run; a daemon that
    hears nothing for half a second has lost its board.
    """
    gc.collect()
    gc.freeze()


@contextlib.contextmanager
def rig_in(
    folder: Path,
    seed: int,
    part: str = "",
    disk: SmallDisk | None = None,
    descriptors: int | None = None,
    *,
    paced: bool = False,
) -> Iterator[FaultRig]:
    """Yield a rig for as long as the block lasts; its run logs go to `disk`, if one is given."""
    rig = FaultRig(folder, seed, part, disk, descriptors, paced=paced)
    try:
        yield rig
    finally:
        rig.close()
