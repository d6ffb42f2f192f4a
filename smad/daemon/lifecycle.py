"""A daemon's life: locks, sockets, port, first handshake; then the end, which disarms.

However it ends, the last line says what happened to the bench, and the exit status says whether
that was asked for: 0 after a signal, 70 when a part of the daemon died.
"""

import asyncio
import contextlib
import os
import secrets
import signal
import traceback
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import zmq

from firmware_protocol.events import IncompatibleReason
from smad.client.endpoints import (
    Connection,
    Endpoints,
    default_folder,
    prepare_folder,
    write_anew,
    write_connection,
)
from smad.config import Config
from smad.daemon import realtime
from smad.daemon.axis import Axis
from smad.daemon.command.reload import has_terminal, reread_keys
from smad.daemon.command.remote import LAST_WORDS_MS
from smad.daemon.daemon import Daemon
from smad.daemon.errors import TaskDied
from smad.daemon.journal import Journal
from smad.daemon.link.port import Opener
from smad.daemon.link.wirerate import check_rate
from smad.daemon.lockfile import LockFile
from smad.daemon.notify import Notifier
from smad.daemon.process import Options, Process
from smad.daemon.runtime_folder import RuntimeFolder
from smad.daemon.sockets.descriptors import (
    OPENED_LATER,
    Descriptors,
    Shares,
    open_descriptors,
    shares_of,
)
from smad.errors import DaemonError, PortError
from smad.version import VERSION

_BOUND, _BOUND_WITH_TCP = 5, 20
"""Descriptors of lock and sockets, more or less."""

_LOOK_S = 1.0
"""How often the daemon looks whether its sockets are still in their folder."""

_SIGNALS = (signal.SIGINT, signal.SIGTERM)


@dataclass(frozen=True)
class Ended:
    """How a daemon ended: exit status and last line."""

    status: int
    line: str


def run(config: Config, openers: Mapping[str, Opener], options: Options) -> Ended:
    """Run a daemon until a signal, and return how it ended; `openers` are by axis.

    Raises SmadError when it cannot start.
    """
    for axis_config in config.by_axis().values() if options.check_baud else ():
        check_rate(axis_config.link.rate_hz, axis_config.link.baud)
    return asyncio.run(_Life(config, openers, options).live())


class _Life:
    def __init__(self, config: Config, openers: Mapping[str, Opener], options: Options) -> None:
        self._config = config
        self._openers = openers
        self._options = options
        folder = Path(config.daemon.ipc_dir or default_folder()).absolute()
        self._endpoints = Endpoints(folder, config.daemon.bench)
        self._journal = Journal()
        self._notifier = Notifier()
        self._descriptors = Descriptors()
        self._umask = 0o077
        self._signal: asyncio.Future[str]
        self._keeping: asyncio.TimerHandle | None = None

    async def live(self) -> Ended:
        self._divide_descriptors(_BOUND_WITH_TCP if self._config.daemon.tcp.enabled else _BOUND)
        umask = self._umask = prepare_folder(self._endpoints.folder)
        lock = self._take_lock(umask)
        context: zmq.Context[zmq.Socket[bytes]] = zmq.Context()
        context.set(zmq.MAX_SOCKETS, min(65_535, context.get(zmq.SOCKET_LIMIT)))
        loop = asyncio.get_running_loop()
        self._signal = loop.create_future()
        for number in _SIGNALS:
            loop.add_signal_handler(number, self._on_signal, number)
        daemon = Daemon(
            self._config,
            self._openers,
            Process(
                loop=loop,
                context=context,
                journal=self._journal,
                notifier=self._notifier,
                nonce=secrets.randbits(32),
                reserve=self._descriptors.reserve,
                options=self._options,
            ),
        )
        # A terminal that goes away ends the daemon that was started there; a service has none.
        if has_terminal():
            loop.add_signal_handler(signal.SIGHUP, self._on_signal, signal.SIGHUP)
        else:
            loop.add_signal_handler(signal.SIGHUP, self._on_reload, daemon)
        loop.set_exception_handler(lambda _, details: _callback_died(daemon, details))
        measures: realtime.Realtime | None = None
        try:
            connection = self._bind(daemon, umask)
            measures = self._take_measures(daemon)
            daemon.start(without_missing=self._options.without_missing)
            await self._first_handshake(daemon)
            write_connection(self._endpoints.connection_file, connection, umask)
            listeners = (*daemon.server.listeners, *daemon.publisher.listeners)
            self._keep(
                daemon,
                RuntimeFolder(
                    self._endpoints, connection, lock, listeners, self._descriptors.reserve
                ),
            )
            self._announce(daemon)
            return await self._until_the_end(daemon)
        finally:
            if self._keeping is not None:
                self._keeping.cancel()
            self._endpoints.connection_file.unlink(missing_ok=True)
            await daemon.close()
            if self._options.trace is not None:
                self._options.trace.save()
            # This waits for the last words of the sockets; one that was left open must not hang it.
            context.destroy(linger=LAST_WORDS_MS)
            if measures is not None:
                measures.close()
            lock.release()
            self._journal.close()

    def _keep(self, daemon: Daemon, place: RuntimeFolder) -> None:
        warning = place.look()
        if warning:
            daemon.say("warning", warning, {})
        self._keeping = daemon.loop.call_later(_LOOK_S, self._keep, daemon, place)

    def _divide_descriptors(self, not_yet_open: int) -> Shares:
        used = open_descriptors() + OPENED_LATER + not_yet_open
        return shares_of(self._descriptors.limit, used, tcp=self._config.daemon.tcp.enabled)

    def _take_lock(self, umask: int) -> LockFile:
        lock = LockFile(self._endpoints.lock, mode=0o644 & ~umask)
        try:
            lock.acquire()
        except BlockingIOError:
            raise DaemonError(
                f"a daemon for the bench {self._endpoints.bench!r} is running already",
                value=lock.holder(),
                action="use it (smad status), end it, or set daemon.bench to another name",
            ) from None
        return lock

    def _bind(self, daemon: Daemon, umask: int) -> Connection:
        endpoints, config = self._endpoints, self._config
        daemon.server.serve_ipc(endpoints, umask)
        tcp = ("", "")
        if config.daemon.tcp.enabled:
            tcp = daemon.server.serve_tcp(config.daemon, endpoints)
        if config.telemetry.enabled:
            daemon.publisher.bind_ipc(endpoints.telemetry, umask)
            if config.telemetry.endpoint:
                daemon.publisher.bind_extra(config.telemetry.endpoint, umask)
            if daemon.publisher.note:
                daemon.status.notes.append(daemon.publisher.note)
        shares = self._divide_descriptors(0)
        self._descriptors.set_reserve_aside()
        daemon.server.share(shares)
        daemon.publisher.share(shares.telemetry)
        return Connection(
            bench=endpoints.bench,
            pid=os.getpid(),
            version=VERSION,
            command=endpoints.command,
            stop=endpoints.stop,
            telemetry=endpoints.telemetry if config.telemetry.enabled else "",
            tcp_command=tcp[0],
            tcp_stop=tcp[1],
            server_key=daemon.server.server_key,
        )

    def _take_measures(self, daemon: Daemon) -> realtime.Realtime:
        measures = realtime.take(self._config.realtime)
        daemon.status.measures = measures.measures
        daemon.collector.enabled = self._config.realtime.freeze_gc
        for missing in measures.missing:
            self._journal.say(f"WARNING, not granted: {missing.name}: {missing.detail}")
        if any(m.name == "SCHED_FIFO" and m.asked for m in measures.missing):
            self._journal.say(
                "WARNING: at ordinary priority a busy machine delays control steps; "
                "only 100 Hz is safe then"
            )
        return measures

    async def _first_handshake(self, daemon: Daemon) -> None:
        timeout_s = self._config.link.connect_timeout_s
        axes = daemon.axes.values()
        identified = asyncio.gather(*(axis.watch.identified.wait() for axis in axes))
        await asyncio.wait(
            (identified, self._signal, daemon.failure),
            timeout=timeout_s,
            return_when=asyncio.FIRST_COMPLETED,
        )
        identified.cancel()
        # Unread, what it was cancelled with would count as the death of a part.
        with contextlib.suppress(asyncio.CancelledError):
            await identified
        if self._signal.done() or daemon.failure.done():
            return
        silent = [axis for axis in axes if not axis.watch.identified.is_set()]
        if silent and not (self._options.without_missing and len(silent) < len(axes)):
            raise _silent(silent[0], timeout_s)
        for axis in axes:
            incompatible = axis.watch.incompatible
            if incompatible is not None and incompatible.reason is IncompatibleReason.MAJOR:
                raise PortError(
                    f"{axis.lead}the board speaks another version of the protocol",
                    value=incompatible.fields[0],
                    limit="the same major version",
                    action="update the older of firmware and smad",
                )

    def _announce(self, daemon: Daemon) -> None:
        axes = daemon.axes.values()
        transports = [axis.link.transport for axis in axes if axis.link.transport is not None]
        # Told when all is well: a refusal to start stays the one line there is.
        granted = (note for transport in transports for note in transport.notes)
        for note in dict.fromkeys((*daemon.status.notes, *granted)):
            self._journal.say(f"note: {note}")
        ports = ", ".join(f"{axis.lead}{axis.config.link.port}" for axis in axes)
        text = f"ready: bench {self._endpoints.bench!r} on {ports}, not armed"
        self._journal.say(text)
        self._notifier.ready(text)

    async def _until_the_end(self, daemon: Daemon) -> Ended:
        await asyncio.wait((self._signal, daemon.failure), return_when=asyncio.FIRST_COMPLETED)
        if daemon.failure.done():
            name, error = daemon.failure.result()
            path = self._keep_traceback(error)
            daemon.say("state", f"the {name} task died: {error!r}", {})
            came_of_it = await daemon.disarm()
            raise TaskDied(
                f"the {name} task died ({type(error).__name__}: {error}): {came_of_it}",
                action=f"please report it with {path}; then start again",
            )
        self._notifier.stopping("disarming")
        came_of_it = await daemon.disarm()
        return Ended(0, f"ended by {self._signal.result()}: {came_of_it}")

    def _keep_traceback(self, error: BaseException) -> Path:
        path = self._endpoints.crash_file
        text = "".join(traceback.format_exception(error))
        with contextlib.suppress(OSError), self._descriptors.reserve():
            write_anew(path, text.encode(), self._umask)
        return path

    def _on_reload(self, daemon: Daemon) -> None:
        with self._descriptors.reserve():
            text = reread_keys(self._config, daemon.server.authenticator, self._options.reread)
        daemon.say("warning", text, {})

    def _on_signal(self, number: int) -> None:
        if not self._signal.done():
            self._signal.set_result(signal.Signals(number).name)


def _silent(axis: Axis, timeout_s: float) -> PortError:
    config = axis.config.link
    counts = axis.link.counts
    if counts.bytes_in == 0:
        return PortError(
            f"{axis.lead}the board does not answer",
            value=f"nothing received on {config.port} in {timeout_s:g} s",
            action="check that it is powered and that this is its port",
        )
    frames = axis.session.stats.decoder.frames
    if frames == 0:
        return PortError(
            f"{axis.lead}what comes from the port is not our protocol",
            value=f"{counts.bytes_in} bytes at {config.baud} baud, none of them a valid frame",
            action="set link.baud to the board's baud rate, or check that this is its port",
        )
    return PortError(
        f"{axis.lead}the board sends, but does not answer",
        value=f"{frames} frames in {timeout_s:g} s, no IDENT",
        action="check the wire to the board (transmit), then its firmware",
    )


def _callback_died(daemon: Daemon, details: dict[str, Any]) -> None:
    error = details.get("exception")
    daemon.fail(part_of(details), error if error is not None else RuntimeError(str(details)))


def part_of(details: dict[str, Any]) -> str:
    """Return the name of what died: its task's, or that of the function the loop called."""
    task = details.get("task")
    if task is not None:
        return str(task.get_name())
    # A handle says only "<Handle Reader.ready() at …>"; the function is in an attribute.
    call = getattr(details.get("handle"), "_callback", None)
    return str(getattr(call, "__qualname__", details.get("message", "loop")))
