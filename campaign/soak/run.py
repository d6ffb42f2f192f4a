"""The soak: a real daemon, a simulated bench that waits for it, and hours of random commands.

Each minute of board time the port goes away and comes back; a subscriber reads slower than samples
come; a second client floods the daemon with commands. Time is counted in samples that the daemon
got, so the soak ends by itself however busy the machine is.
"""

from __future__ import annotations

import random
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import zmq
from msgspec import Struct

from campaign.rig import BAUD, DaemonRig, rig_config, start_daemon
from campaign.scripted_client import ScriptedClient
from campaign.soak.bench import READY
from campaign.soak.draws import SAFE_ONLY, draw_command
from campaign.soak.found import Logged, Stage, StageResult, Usage, not_logged
from smad import api
from smad.client.endpoints import read_connection
from smad.client.wire import subscribe
from smad.config import LinkConfig, RecorderConfig, TelemetryConfig
from smad.daemon.telemetry.blackbox import FOLDER as BLACK_BOX
from smad.errors import DaemonError, RunLogError
from smad.progress import Say
from smad.runlog.reader import read_run

BLACK_BOX_S = 5.0
SPEED = 50.0
"""Board time over wall time at most; the daemon's answers usually take longer."""

_AWAY = ("disconnected", "sync")
_TURN_S = 0.002
_IN_FLIGHT = 200
_COMMAND_EVERY_S = 0.7
_PATIENCE_S = 120.0
_TELEMETRY_EVERY_TURNS = 20


class SoakRig(DaemonRig):
    """The processes of a soak: the bench that waits for its host, and the daemon."""

    def __init__(self, folder: Path, stage: Stage, seed: int) -> None:
        port = folder / "device.tty"
        self._bench = subprocess.Popen(
            [
                *(sys.executable, "-m", "campaign.soak.bench"),
                *(str(stage.rate_hz), str(seed), str(SPEED), str(port)),
            ],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )
        assert self._bench.stdin is not None
        assert self._bench.stdout is not None
        self._input, self._output = self._bench.stdin, self._bench.stdout
        if self._output.readline().strip() != READY:
            raise DaemonError("the bench of the soak did not start")
        config = rig_config(
            folder,
            str(port),
            link=LinkConfig(
                port=str(port), baud=BAUD, rate_hz=stage.rate_hz, reconnect_interval_s=0.05
            ),
            # What is kept in memory for after a fault is full before growth is looked at.
            recorder=RecorderConfig(
                folder=str(folder / "runs"), automatic=False, black_box_s=BLACK_BOX_S
            ),
            telemetry=TelemetryConfig(endpoint="", high_water_mark=100),
        )
        super().__init__(folder, start_daemon(folder, config))

    def inject(self, text: str) -> None:
        """Break something of the bench with the next sample."""
        print(text, file=self._input, flush=True)

    def end_bench(self) -> int:
        """End the bench; return how often it waited in vain for an armed host."""
        out, _ = self._bench.communicate(timeout=_PATIENCE_S)
        return int(out.split()[1])

    def close(self) -> None:
        """End the daemon and the bench."""
        super().close()
        self._bench.kill()
        self._bench.wait()

    def __enter__(self) -> SoakRig:
        return self

    def __exit__(self, *error: object) -> None:
        self.close()


class Soak:
    """One stage, turn by turn."""

    def __init__(self, rig: SoakRig, stage: Stage, seed: int, say: Say) -> None:
        connection = read_connection(rig.folder / "bench.json")
        assert connection is not None
        self.result = StageResult(stage, seed)
        self._rig = rig
        self._stage = stage
        self._say = say
        self._rng = random.Random(f"soak {seed} {stage.rate_hz}")
        self._caller = ScriptedClient(connection.command)
        self._flood = ScriptedClient(connection.command)
        self._to_flood = 0
        self._context: zmq.Context[zmq.Socket[bytes]] = zmq.Context()
        self._slow = subscribe(self._context, connection.telemetry, b"", queue=1)

    def run(self) -> StageResult:
        """Run the stage to its end, and leave the daemon ready to be ended."""
        began_s = time.monotonic()
        self._order(api.StartRecording(name="soak"))
        self._wait(lambda status: status["board"] is not None)
        # The first writing of what is kept in memory starts its thread; those after it add nothing.
        self._order(api.RecordLast(seconds=1.0))
        for turn in self._turns():
            if turn % _TELEMETRY_EVERY_TURNS == 0:
                self._read_slowly()
            self._pour()
            time.sleep(_TURN_S)
        self._finish()
        self.result.wall_s = time.monotonic() - began_s
        return self.result

    def close(self) -> None:
        """Give the sockets back."""
        self._context.destroy(linger=0)
        self._caller.close()
        self._flood.close()

    def _turns(self) -> Iterator[int]:
        stage, rng = self._stage, self._rng
        events: list[tuple[float, Callable[[], None], Callable[[], float]]] = [
            (0.5, self._random_command, lambda: rng.expovariate(1.0 / _COMMAND_EVERY_S)),
            (stage.reconnect_every_s / 2, self._unplug, lambda: stage.reconnect_every_s),
            (stage.flood_every_s / 3, self._begin_flood, lambda: stage.flood_every_s),
            (0.0, self._look, lambda: stage.look_every_s),
            (stage.seconds / 2, self._stop_and_power_cycle, lambda: stage.seconds),
        ]
        turn = 0
        while (now_s := self._now_s()) < stage.seconds:
            for n, (due_s, act, gap_s) in enumerate(events):
                if now_s >= due_s:
                    act()
                    events[n] = (max(now_s, due_s) + gap_s(), act, gap_s)
            turn += 1
            yield turn

    def _now_s(self) -> float:
        status = self._caller.call(api.GetStatus()).result
        self._take_counts(status)
        return self.result.board_s

    def _take_counts(self, status: dict[str, Any]) -> None:
        stage_result, counts = self.result, status["counts"]
        stage_result.samples, stage_result.missed = counts["samples"], counts["missed"]
        stage_result.skipped, stage_result.losses = counts["skipped"], status["link"]["losses"]
        stage_result.board_s = stage_result.samples / self._stage.rate_hz

    def _order(self, command: Struct) -> bool:
        """Send a command; whether it was carried out."""
        return not self._caller.call(command).refused

    def _random_command(self) -> None:
        motion = self._caller.call(api.GetMotion()).result
        # Left to chance alone the bench would hardly ever be armed.
        if motion["fault"] is not None:
            self._order(api.Clear())
        elif motion["mode"] == "SAFE":
            # Parameters are set and saved only here, where it never stays for long.
            if self._rng.random() < 0.5:
                self._order(draw_command(self._rng, SAFE_ONLY))
            self.result.armings += self._order(api.Arm())
        self._order(draw_command(self._rng))

    def _unplug(self) -> None:
        seconds, renamed = self._rng.uniform(0.05, 2.0), self._rng.randint(0, 1)
        self._rig.inject(f"unplug@0:seconds={seconds:.3f},renamed={renamed}")
        self.result.reconnects += 1

    def _begin_flood(self) -> None:
        self._to_flood += self._stage.flood

    def _pour(self) -> None:
        """Keep so many commands of the flood on their way; one in four is no command."""
        self._flood.drain()
        while self._to_flood and self._flood.unanswered < _IN_FLIGHT:
            self._to_flood -= 1
            if self._to_flood % 4:
                self._flood.send(api.GetMotion())
            else:
                self._flood.send_raw(self._rng.randbytes(self._rng.randint(1, 200)))

    def _stop_and_power_cycle(self) -> None:
        # Refused while the port is away.
        self._wait(lambda status: self._order(api.EStop()))
        self._wait(lambda status: status["motion"]["mode"] == "ESTOP")
        self._rig.inject("power_cycle@0")
        self._wait(lambda status: status["motion"]["mode"] == "SAFE")

    def _wait(self, done: Callable[[dict[str, Any]], bool]) -> None:
        self._rig.wait(
            "the bench comes to the state that it has to",
            lambda: done(self._caller.call(api.GetStatus()).result),
            _PATIENCE_S,
            lambda: time.sleep(_TURN_S),
        )

    def _read_slowly(self) -> None:
        if self._slow.poll(0):
            self._slow.recv_multipart()
            self.result.telemetry_read += 1

    def _look(self) -> None:
        # What is held while the port is away, or the black box is written, is no measure of growth.
        self._wait(lambda status: status["link"]["state"] not in _AWAY and not self._writes())
        self.result.usage.append(usage_of(self._rig.daemon.process.pid, self.result.board_s))
        self._say(f"{self._stage.name}: {self.result.board_s:.0f} s")

    def _writes(self) -> bool:
        """Whether the black box's file is open; one that is left open ends the soak's patience."""
        open_files = Path(f"/proc/{self._rig.daemon.process.pid}/fd")
        return any(file.resolve().parent.name == BLACK_BOX for file in open_files.iterdir())

    def _finish(self) -> None:
        stage_result = self.result
        while self._to_flood:
            self._pour()
        self._flood.drain_all()
        stage_result.flooded, stage_result.flood_answered = self._flood.sent, self._flood.answered
        self._order(api.Disarm())
        self._take_counts(self._caller.call(api.GetStatus()).result)
        stage_result.recorded_rows = self._caller.call(api.StopRecording()).result["rows"]
        stage_result.commands = self._caller.acknowledged


def usage_of(process: int, at_s: float) -> Usage:
    """What a process holds now, from /proc."""
    place = Path(f"/proc/{process}")
    fields = dict(
        line.split(":", 1) for line in (place / "status").read_text().splitlines() if ":" in line
    )
    return Usage(
        at_s=at_s,
        rss_MiB=int(fields["VmRSS"].split()[0]) / 1024,
        descriptors=len(list((place / "fd").iterdir())),
        threads=int(fields["Threads"]),
    )


def run_stage(stage: Stage, seed: int, say: Say) -> StageResult:
    """Run one stage with processes of its own, and read back what it logged.

    Raises SmadError when the processes cannot be brought up, or do not answer any more.
    """
    # Socket paths are short.
    with tempfile.TemporaryDirectory(prefix="smad-soak-") as name:
        folder = Path(name)
        with SoakRig(folder, stage, seed) as rig:
            rig.daemon.wait_until_ready()
            soak = Soak(rig, stage, seed, say)
            try:
                stage_result = soak.run()
            finally:
                soak.close()
            stage_result.status = rig.daemon.end(signal.SIGTERM)
            stage_result.last_line = rig.daemon.last_line
            stage_result.host_timeouts = rig.end_bench()
            read_back(stage_result, folder / "runs")
    return stage_result


def read_back(stage_result: StageResult, runs: Path) -> None:
    """Compare the run logs in `runs` with what was seen and acknowledged."""
    logged: list[Logged] = []
    for path in sorted(runs.glob("*.mcap")):
        try:
            run = read_run(path)
        except RunLogError as error:
            stage_result.log_error = str(error)
            return
        stage_result.logged_rows += len(run)
        stage_result.log_dropped += run.dropped
        if run.cut_short or run.damaged:
            stage_result.log_error = "; ".join(run.notes)
        ticks = run.columns["tick"].astype(np.int64)
        stage_result.logged_gaps += int((((ticks[1:] - ticks[:-1]) & 0xFFFF) != 1).sum())
        logged += [(event.text, event.data) for event in run.events]
        # A status would miss what is cleared before the next one.
        stage_result.faults += [event.data["name"] for event in run.events if event.kind == "fault"]
    stage_result.not_logged = not_logged(stage_result.commands.commands, logged)
