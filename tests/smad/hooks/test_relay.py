"""The relay that falls when the daemon's heartbeat ends."""

import subprocess
import sys
import threading
from collections.abc import Iterator
from http.server import BaseHTTPRequestHandler, HTTPServer
from pathlib import Path
from urllib.parse import parse_qs, urlsplit

import psutil
import pytest

from firmware_protocol.enums import BoardState
from smad.hooks import relay as relays
from smad.hooks.relay import (
    PULSE_DECISECONDS,
    RENEW_S,
    SILENT_S,
    Heartbeat,
    HoldingRelay,
    RelayError,
    TasmotaRelay,
)


def test_the_supply_may_be_on_while_samples_come_and_falls_when_they_end() -> None:
    heartbeat = Heartbeat([b"smad"])
    assert heartbeat.reason(0.0) == "no sample came from the daemon"
    for n in range(100):
        heartbeat.beat(0.01 * n, BoardState.ARMED, b"smad")
        assert heartbeat.reason(0.01 * n + 0.5 * SILENT_S) == ""
    assert "for 1.0 s" in heartbeat.reason(0.99 + SILENT_S)


def test_the_supply_falls_when_one_of_several_axes_falls_silent() -> None:
    heartbeat = Heartbeat([b"axis/pitch", b"axis/yaw"])
    heartbeat.beat(0.0, BoardState.ARMED, b"axis/pitch")
    for n in range(200):
        heartbeat.beat(0.01 * n, BoardState.ARMED, b"axis/yaw")
    assert heartbeat.reason(0.99) == ""
    assert "of axis/pitch" in heartbeat.reason(2.0)


def test_the_supply_stays_off_while_one_of_several_axes_never_sent_a_sample() -> None:
    heartbeat = Heartbeat([b"axis/pitch", b"axis/yaw"])
    heartbeat.beat(0.0, BoardState.SAFE, b"axis/yaw")
    assert not heartbeat.began
    assert heartbeat.reason(0.1) == "no sample of axis/pitch came from the daemon"


@pytest.mark.parametrize("state", [BoardState.FAULT, BoardState.ESTOP])
def test_the_supply_falls_with_a_fault_and_an_emergency_stop(state: BoardState) -> None:
    heartbeat = Heartbeat([b"smad"])
    heartbeat.beat(0.0, BoardState.ARMED, b"smad")
    heartbeat.beat(0.01, state, b"smad")
    heartbeat.beat(0.011, BoardState.ARMED, b"smad")
    assert heartbeat.reason(0.01) == f"the board is in {state.name}"


def test_silence_and_the_pulse_of_a_plug_together_cut_within_two_seconds() -> None:
    assert SILENT_S + 0.1 < 2.0
    assert RENEW_S + PULSE_DECISECONDS / 10 < 2.0


@pytest.fixture
def plug() -> Iterator[tuple[str, list[str]]]:
    asked: list[str] = []

    class Handler(BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            asked.extend(parse_qs(urlsplit(self.path).query)["cmnd"])
            self.send_response(200)
            self.end_headers()
            self.wfile.write(b'{"POWER":"ON"}')

        def log_message(self, *arguments: object) -> None:
            pass

    server = HTTPServer(("127.0.0.1", 0), Handler)
    threading.Thread(target=server.serve_forever, daemon=True).start()
    yield f"http://127.0.0.1:{server.server_port}/", asked
    server.shutdown()
    server.server_close()


def test_a_plug_is_switched_on_for_a_short_time_only(
    plug: tuple[str, list[str]], monkeypatch: pytest.MonkeyPatch
) -> None:
    # The plug is a thread of ours, which a busy machine may hold up.
    monkeypatch.setattr(relays, "_HTTP_S", 60.0)
    address, asked = plug
    relay = TasmotaRelay(address)
    relay.renew()
    relay.cut()
    assert asked == ["Backlog PulseTime1 15; Power1 ON", "Power1 OFF"]


def test_a_plug_that_does_not_answer_is_told() -> None:
    with pytest.raises(RelayError, match="opens by itself"):
        TasmotaRelay("http://127.0.0.1:1").renew()
    with pytest.raises(RelayError, match="does not answer"):
        TasmotaRelay("nonsense").renew()


def test_a_lost_answer_of_a_plug_cuts_nothing_and_a_silent_plug_is_told_before_it_falls(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    now_s, asked_s = 0.0, list[float]()
    # After so many seconds. A plug counts from when it was asked.
    answers = iter([0.0, None, 0.35])

    def wait(seconds: float) -> None:
        nonlocal now_s
        now_s += seconds

    def ask(command: str) -> None:
        asked_s.append(now_s)
        answered_s = next(answers, None)
        wait(relays._HTTP_S if answered_s is None else answered_s)
        if answered_s is None:
            raise RelayError("the plug does not answer")

    relay = TasmotaRelay("http://plug.lab", clock_s=lambda: now_s, sleep=wait)
    monkeypatch.setattr(relay, "_ask", ask)
    relay.renew()
    wait(RENEW_S)
    relay.renew()
    assert len(asked_s) == 3
    wait(asked_s[2] + RENEW_S - now_s)
    with pytest.raises(RelayError):
        relay.renew()
    # Renewed after it has fallen, it would close by itself.
    assert asked_s[-1] + relays._HTTP_S < asked_s[2] + PULSE_DECISECONDS / 10


def test_a_holding_command_runs_until_the_supply_is_cut(tmp_path: Path) -> None:
    relay = HoldingRelay(["sleep", "1000"])
    relay.renew()
    relay.renew()
    assert relay._process is not None
    assert relay._process.poll() is None
    relay.cut()
    assert relay._process.poll() is not None
    with pytest.raises(RelayError, match="sleep ended"):
        relay.renew()
    with pytest.raises(RelayError, match="cannot start"):
        HoldingRelay(["/no/such/program"]).renew()


def test_the_supply_is_cut_with_all_that_the_holding_command_began() -> None:
    relay = HoldingRelay(["sh", "-c", "sleep 1000; true"])
    relay.renew()
    assert relay._process is not None
    shell = psutil.Process(relay._process.pid)
    while not (held := shell.children()):
        pass
    relay.cut()
    _, alive = psutil.wait_procs(held, timeout=120.0)
    assert not [process for process in alive if process.status() != psutil.STATUS_ZOMBIE]


_HOLDER = """
import sys
from smad.hooks.relay import HoldingRelay
relay = HoldingRelay(["sleep", "1000"])
relay.renew()
print(relay._process.pid, flush=True)
sys.stdin.read()
"""


def test_the_supply_falls_when_the_relays_own_process_is_killed() -> None:
    holder = subprocess.Popen(
        [sys.executable, "-c", _HOLDER], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    )
    assert holder.stdout is not None
    held = psutil.Process(int(holder.stdout.readline()))
    holder.kill()
    holder.wait()
    _, alive = psutil.wait_procs([held], timeout=120.0)
    assert not [process for process in alive if process.status() != psutil.STATUS_ZOMBIE]
