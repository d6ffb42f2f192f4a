"""Looks at the bench and at its queue four times a second, and lets hooks know what happened."""

import contextlib
import shutil
import time
from pathlib import Path
from typing import get_args

import msgspec

from firmware_protocol.nearest import instead
from smad.client import Client
from smad.config import HooksConfig, parse_config
from smad.errors import CommandError, SmadError
from smad.files import write_whole
from smad.hooks.commands import HookCommands
from smad.hooks.events import Detector, Event, Name, Observation, WatcherState
from smad.progress import Say
from smad.queue.lease import RunnerLease
from smad.queue.states import Snapshot
from smad.queue.store import FILE, Message, Store

POLL_S = 0.25
TIMEOUT_S = 0.5
HOOKS: tuple[str, ...] = get_args(Name)


class Watcher:
    """A client that only looks. `folder` is that of the queue; left out, of the run logs."""

    def __init__(self, bench: str, folder: Path | None) -> None:
        self._bench = bench
        self._folder = folder
        self._client: Client | None = None
        self._store: Store | None = None
        self._last_message: int | None = None

    def config(self) -> HooksConfig:
        """Return the hooks of the daemon's configuration. Raises SmadError."""
        with Client(self._bench) as client:
            config = parse_config(client.config())
            if self._folder is None:
                self._folder = Path(client.status().recorder.folder)
        return config.hooks

    def known(self) -> WatcherState | None:
        """Return what an earlier watcher saw last; None: there was none, or its file is damaged.

        What the queue says from there on is new, and all that a queue says that is not there yet.
        """
        assert self._folder is not None
        if not (self._folder / FILE).exists():
            self._last_message = 0
        with contextlib.suppress(OSError, msgspec.MsgspecError):
            state = msgspec.json.decode(self._file().read_bytes(), type=WatcherState)
            self._last_message = state.message
            return state
        return None

    def keep(self, state: WatcherState) -> None:
        """Write down what has been told. A disk that refuses only costs the catching up."""
        with contextlib.suppress(OSError):
            # The daemon makes it with its first run log.
            self._file().parent.mkdir(parents=True, exist_ok=True)
            write_whole(self._file(), msgspec.json.encode(state))

    def _file(self) -> Path:
        assert self._folder is not None
        return self._folder / f"hooks-{self._bench}.json"

    def look(self) -> Observation:
        """Return what bench, disk and queue show now."""
        status = None
        try:
            if self._client is None:
                self._client = Client(self._bench, timeout_s=TIMEOUT_S)
            status = self._client.status()
            if self._folder is None and status.recorder.folder:
                self._folder = Path(status.recorder.folder)
        except SmadError:
            self._disconnect()
        look = Observation(unix_s=time.time(), clock_s=time.monotonic(), status=status)
        if self._folder is None:
            return look
        snapshot: Snapshot | None = None
        messages: tuple[Message, ...] = ()
        with contextlib.suppress(SmadError):
            store = self._opened()
            if store is not None:
                snapshot, messages = store.snapshot(), self._new_messages(store)
        return msgspec.structs.replace(
            look,
            free_MB=_free_MB(self._folder),
            snapshot=snapshot,
            messages=messages,
            message=self._last_message or 0,
            has_runner=RunnerLease(self._folder).runs(),
        )

    def close(self) -> None:
        """Give sockets and file back."""
        self._disconnect()
        if self._store is not None:
            self._store.close()

    def _disconnect(self) -> None:
        if self._client is not None:
            self._client.close()
            self._client = None

    def _opened(self) -> Store | None:
        assert self._folder is not None
        if self._store is not None and not self._store.in_place:
            self._store.close()
            self._store, self._last_message = None, 0
        if self._store is None and (self._folder / FILE).exists():
            self._store = Store(self._folder / FILE)
            earlier = self._store.messages()
            newest = earlier[-1].id if earlier else 0
            if self._last_message is None:
                self._last_message = newest
            elif self._last_message > newest:
                # Somebody moved the queue away; this is a new one.
                self._last_message = 0
        return self._store

    def _new_messages(self, store: Store) -> tuple[Message, ...]:
        messages = store.messages(after=self._last_message or 0)
        if messages:
            self._last_message = messages[-1].id
        return messages


def watch(bench: str, folder: Path | None, say: Say) -> None:
    """Watch a bench, and the queue in `folder`, for ever; see `Watcher`. Raises SmadError.

    What was told is written down once its commands have ended: a watcher that is killed before
    lets the next one tell it again.
    """
    watcher = Watcher(bench, folder)
    config = watcher.config()
    commands = commands_of(config, say)
    detector = Detector(bench, config, known=watcher.known())
    written: WatcherState | None = None
    say(f"watching bench {bench}")
    try:
        while True:
            for event in detector.events(watcher.look()):
                say(f"{event.event}: {event.text}")
                commands.fire(event)
            commands.tick()
            if not commands.busy and detector.known != written:
                written = detector.known
                watcher.keep(written)
            time.sleep(POLL_S)
    finally:
        commands.close()
        watcher.close()


def commands_of(config: HooksConfig, say: Say) -> HookCommands:
    """Return the commands of a configuration."""
    return HookCommands(
        {name: getattr(config, name) for name in HOOKS},
        timeout_s=config.timeout_s,
        say=say,
        clock_s=time.monotonic,
    )


def try_hook(name: str, bench: str, say: Say) -> None:
    """Run one hook with a made-up event, and wait for its end. Raises CommandError."""
    if name not in HOOKS:
        raise CommandError("there is no such hook", value=name, action=instead(name, HOOKS))
    commands = commands_of(Watcher(bench, None).config(), say)
    fields = {"event": name, "bench": bench, "unix_s": time.time(), "text": f"a test of {name}"}
    if not commands.fire(msgspec.convert(fields, Event)):
        raise CommandError(
            f"the daemon's configuration has no {name}",
            action="set it in section [hooks], and restart the daemon",
        )
    while commands.busy:
        time.sleep(POLL_S)
        commands.tick()


def _free_MB(folder: Path) -> float | None:
    try:
        return shutil.disk_usage(folder).free / 1e6
    except OSError:
        return None
