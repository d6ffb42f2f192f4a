"""Hooks that hang, fail, flood, or are not there; and the examples that are shipped."""

import json
import os
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from http.server import BaseHTTPRequestHandler, HTTPServer
from pathlib import Path

import pytest

from smad.hooks.commands import MOST_WAITING, HookCommands
from smad.hooks.events import Event

EXAMPLES = Path(__file__).resolve().parents[3] / "examples" / "hooks"
EVENT = Event(event="on_fault", bench="bench", unix_s=1.0, text="OVER_TEMPERATURE at X")


class Hooks:
    """Commands with a clock that the test moves."""

    def __init__(self, *words: str, timeout_s: float = 60.0) -> None:
        self.said: list[str] = []
        self.now_s = 0.0
        self.commands = HookCommands(
            {"on_fault": words},
            timeout_s=timeout_s,
            say=self.said.append,
            clock_s=lambda: self.now_s,
        )

    def fire(self) -> None:
        assert self.commands.fire(EVENT)

    def until(self, over: Callable[[], bool]) -> None:
        ticks = threading.Event()
        while not over():
            self.commands.tick()
            ticks.wait(0.01)

    def finish(self) -> list[str]:
        self.until(lambda: not self.commands.busy)
        return self.said


def python(code: str) -> tuple[str, ...]:
    return (sys.executable, "-c", code)


def test_a_hook_gets_the_event_as_json_on_its_standard_input(tmp_path: Path) -> None:
    target = tmp_path / "event.json"
    hooks = Hooks(*python(f"import sys; open({str(target)!r}, 'w').write(sys.stdin.read())"))
    hooks.fire()
    assert hooks.finish() == ["on_fault: done: OVER_TEMPERATURE at X"]
    assert json.loads(target.read_text())["text"] == EVENT.text


def test_a_hook_that_hangs_is_killed_after_its_time_with_what_it_began() -> None:
    hooks = Hooks("/bin/sh", "-c", "sleep 1000 & sleep 1000", timeout_s=5.0)
    hooks.fire()
    hooks.commands.tick()
    assert hooks.commands.busy
    hooks.now_s = 5.0
    assert hooks.finish() == ["on_fault: killed, it took longer than 5 s"]


def test_a_hook_that_floods_and_one_that_does_not_read_hold_up_nobody() -> None:
    hooks = Hooks(*python("print('x' * 5_000_000); print('the end'); raise SystemExit(3)"))
    hooks.fire()
    assert hooks.finish() == ["on_fault: failed with status 3: the end"]


def test_a_child_that_a_hook_leaves_with_its_output_holds_up_nobody_for_long() -> None:
    hooks = Hooks("/bin/sh", "-c", "echo left; sleep 1000 & exit 2")
    hooks.fire()
    running = hooks.commands._running["on_fault"]
    hooks.until(lambda: running.ended_s is not None and bool(running.said))
    hooks.now_s = 1.0
    assert hooks.finish() == ["on_fault: failed with status 2: left"]
    os.killpg(running.process.pid, signal.SIGKILL)


def test_a_hook_that_is_not_there_is_told() -> None:
    hooks = Hooks("/no/such/program")
    hooks.fire()
    assert hooks.said == ["on_fault: /no/such/program cannot be started: No such file or directory"]


def test_a_flood_of_events_begins_one_command_at_a_time_and_drops_the_oldest() -> None:
    hooks = Hooks("/bin/sh", "-c", "sleep 1000", timeout_s=5.0)
    for _ in range(MOST_WAITING + 3):
        hooks.fire()
    assert len([text for text in hooks.said if "dropped" in text]) == 2
    hooks.commands.close()
    assert not hooks.commands.busy


def test_an_event_without_a_hook_is_left() -> None:
    assert not HookCommands({"on_fault": ()}, timeout_s=1.0, say=print, clock_s=lambda: 0.0).fire(
        EVENT
    )


@pytest.fixture
def posted() -> Iterator[tuple[str, list[tuple[str, bytes]]]]:
    bodies: list[tuple[str, bytes]] = []

    class Handler(BaseHTTPRequestHandler):
        def do_POST(self) -> None:
            bodies.append((self.path, self.rfile.read(int(self.headers["Content-Length"]))))
            self.send_response(200)
            self.end_headers()

        def log_message(self, *arguments: object) -> None:
            pass

    server = HTTPServer(("127.0.0.1", 0), Handler)
    thread = threading.Thread(target=server.serve_forever, daemon=True)
    thread.start()
    yield f"http://127.0.0.1:{server.server_port}", bodies
    server.shutdown()
    server.server_close()


@pytest.mark.parametrize("service", ["ntfy", "telegram", "slack"])
def test_the_example_posts_the_event(
    service: str, posted: tuple[str, list[tuple[str, bytes]]], tmp_path: Path
) -> None:
    address, bodies = posted
    secret = tmp_path / "secret.txt"
    secret.write_text(f"{address}/topic\n")
    target = f"{address}/topic" if service == "ntfy" else str(secret)
    hooks = Hooks(sys.executable, str(EXAMPLES / "post.py"), service, target, "42")
    hooks.fire()
    assert hooks.finish() == ["on_fault: done: OVER_TEMPERATURE at X"]
    ((path, body),) = bodies
    assert path == "/topic"
    assert b"bench: OVER_TEMPERATURE at X" in body


def test_the_example_that_mails_hands_a_whole_message_to_sendmail(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    sendmail = tmp_path / "sendmail"
    sendmail.write_text(f'#!/bin/sh\necho "$@" > {tmp_path}/words; cat > {tmp_path}/mail\n')
    sendmail.chmod(0o755)
    monkeypatch.setenv("SENDMAIL", str(sendmail))
    hooks = Hooks(sys.executable, str(EXAMPLES / "mail.py"), "you@example.org")
    hooks.fire()
    assert hooks.finish() == ["on_fault: done: OVER_TEMPERATURE at X"]
    assert (tmp_path / "words").read_text() == "-i you@example.org\n"
    assert "Subject: smad bench: OVER_TEMPERATURE at X" in (tmp_path / "mail").read_text()
