"""The blocking client: one method for each command of `smad.api`; every wait has a deadline.

Written by `python -m tools.blocking_client` from asynchronous.py: edit that.
"""

from __future__ import annotations

import contextlib
import weakref
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

from smad import api
from smad.client.channel import Channel
from smad.client.commands import Commands
from smad.client.endpoints import Connection
from smad.client.errors import Refused
from smad.client.renewal import DEFAULT_LEASE_S, Renewal, program_name
from smad.client.signals import ended_by_signals
from smad.client.wire import Keys, find_daemon, remote
from smad.control.commands import Trajectory
from smad.control.pieces import first_pieces
from smad.errors import SmadError

DEFAULT_TIMEOUT_S = 5.0


class Axis(Commands):
    """One axis of a bench that has several: `bench["pitch-1"]`. Stops are the bench's."""

    def __init__(self, bench: Client, name: str) -> None:
        self.name = name
        self.timeout_s = bench.timeout_s
        self._bench = bench
        self._channel = bench._channel

    def arm(self) -> api.Motion:
        """Arm this axis alone; see the bench's."""
        return self._bench.arm(self.name)

    def _ended(self, motion: api.Motion) -> None:
        self._bench._ended(self._bench.motion())


class Client(Commands):
    """A client of the daemon of one bench.

    It finds a daemon on this machine by the name `bench`, in `folder` if its sockets are not in the
    usual place. `Client.remote(...)` connects to a daemon on another machine.

    A client that arms takes exclusive control and keeps it until it disarms, under a lease of
    `lease_s` that it renews in the background. If the program is killed, the daemon disarms after
    that time. With None there is no lease: other clients may command, and nothing disarms.

    If the bench has several axes, `client["pitch-1"]` is one of them; `arm`, `move` and `idle` act
    on several. With `axis`, every method except the stops acts on that axis.

    Raises NoDaemon if no daemon is running. Every method may raise NoAnswer after `timeout_s`, and
    Refused (NotReady, NotInControl, BoardRefused) if the daemon refuses.
    """

    def __init__(
        self,
        bench: str = "bench",
        *,
        axis: str = "",
        folder: str | Path | None = None,
        timeout_s: float = DEFAULT_TIMEOUT_S,
        lease_s: float | None = DEFAULT_LEASE_S,
    ) -> None:
        self.name = axis
        self._open(find_daemon(bench, folder), None, timeout_s, lease_s)

    @classmethod
    def remote(
        cls,
        address: str,
        stop_address: str,
        keys: Keys,
        *,
        telemetry: str = "",
        timeout_s: float = DEFAULT_TIMEOUT_S,
        lease_s: float | None = DEFAULT_LEASE_S,
    ) -> Client:
        """A client of a daemon on another machine: `tcp://host:port` for commands and for stops."""
        client = cls.__new__(cls)
        client.name = ""
        connection = remote(address, stop_address, telemetry, keys)
        client._open(connection, keys, timeout_s, lease_s)
        return client

    def _open(
        self, connection: Connection, keys: Keys | None, timeout_s: float, lease_s: float | None
    ) -> None:
        self.connection = connection
        self.timeout_s = timeout_s
        self.lease_s = lease_s
        self._leased = False
        """Whether the lease is the one that arming takes by itself."""
        self._may_be_armed = False
        """This client asked to arm, and does not know that the bench has been disarmed since."""
        self._control_lease_s: float | None = None
        """How long the lease of `in_control` lasts, inside its block."""
        self._renewal = Renewal(connection, keys)
        # A client that nobody has any more is none that could be missed.
        weakref.finalize(self, self._renewal.end)
        self._channel = Channel(connection, keys)
        self._conversation = self._channel.conversation

    def __getitem__(self, axis: str) -> Axis:
        return Axis(self, axis)

    def __enter__(self) -> Client:
        return self

    def __exit__(self, *error: object) -> None:
        self.close()

    def close(self) -> None:
        """Close the sockets. If this client has armed, the daemon disarms when the lease lapses."""
        self._renewal.end()
        self._channel.close()

    def arm(self, *axes: str) -> api.Motion:
        """Arm the bench, or the named axes.

        After anybody has stopped the bench, the daemon refuses this client's later requests. It
        also refuses to arm again, unless the only stop was a disarm of this client. A person starts
        again with a new client, `clear`, or `as_of(None)`.
        """
        known, may_be_armed = self._conversation.known, self._may_be_armed
        # Before anything is armed: who is killed while it arms is missed, too.
        if self._leased or (self.lease_s is not None and not self._conversation.lease):
            self._take_lease()
            # A stop that came meanwhile, also our own, is not known to who asked for this.
            self._conversation.known = known
        self._may_be_armed, self._conversation.lapsed = True, False
        try:
            motion = self._call(api.Arm(), api.Motion, axes=axes)
        except Refused as refused:
            self._may_be_armed = may_be_armed
            if self._leased and refused.reason is not api.Reason.ARMED:
                self._return_lease()
            raise
        except BaseException:
            # It may be armed: only the lease's end is sure to disarm it now.
            if self._leased:
                self._renewal.end()
            raise
        self._conversation.begin(motion.generation, known=motion.generation)
        return motion

    def _take_lease(self) -> None:
        lease_s = DEFAULT_LEASE_S if self.lease_s is None else self.lease_s
        self.take_control(program_name(), lease_s)
        self._leased = True
        self._renewal.begin(self._conversation.lease, lease_s)

    def _return_lease(self) -> None:
        # Without an answer it lapses.
        with contextlib.suppress(SmadError):
            self.release_control()
        self._conversation.lease = ""
        self._leased = False

    @property
    def known(self) -> int | None:
        """The generation of the last stop that this client knows of; None: it knows of none."""
        return self._conversation.known

    def as_of(self, generation: int | None) -> int | None:
        """Let the daemon refuse later requests, and arming, if a stop came after `generation`.

        Use it to pass on what a person asked who knew of the stops up to that one
        (`Motion.generation`). None forgets all stops. Returns the generation that was in force.
        """
        before = self._conversation.known
        self._conversation.begin(generation, known=generation)
        return before

    def disarm(self) -> api.Motion:
        """Switch the current off, and the water on until cool; return when the board has disarmed.

        The request uses the stop channel, which the daemon serves first. Raises BoardRefused if the
        board does not confirm within a second; the daemon continues to ask it.
        """
        # From here on nothing keeps a bench armed whose disarm is not answered.
        self._renewal.end()
        try:
            motion = self._call(api.Disarm(), api.Motion, stop=True)
        except BaseException:
            if self._leased:
                # Nor does any later call.
                self._conversation.lease, self._leased = "", False
            raise
        self._may_be_armed = False
        self._conversation.stopped(motion.generation)
        if self._leased:
            self._return_lease()
        elif self._control_lease_s is not None:
            self._renewal.begin(self._conversation.lease, self._control_lease_s)
        return motion

    def estop(self) -> api.Motion:
        """Switch everything off until the power is cycled; return when the board says ESTOP."""
        motion = self._call(api.EStop(), api.Motion, stop=True)
        self._may_be_armed = False
        return motion

    def move(
        self,
        *trajectories: Trajectory | Mapping[str, Trajectory | Sequence[Trajectory]],
        queue: bool = False,
    ) -> api.Motion:
        """Follow trajectories one after the other; `queue` appends them to the present motion.

        A mapping from axes to trajectories begins on all these axes together; with `queue`, when
        the slowest of them has ended its motion.
        """
        pieces = [piece for piece in trajectories if not isinstance(piece, Mapping)]
        groups = [group for group in trajectories if isinstance(group, Mapping)]
        if not groups:
            return self._follow(pieces, queue=queue)
        if pieces:
            raise TypeError("trajectories of several axes are given as mappings alone")
        for number, group in enumerate(groups):
            motion = self._begin_together(group, queue=queue or number > 0)
        return motion

    def _begin_together(
        self, group: Mapping[str, Trajectory | Sequence[Trajectory]], *, queue: bool
    ) -> api.Motion:
        begin, later = first_pieces(group)
        motion = self._begin(api.Together(moves=begin, queue=queue), *begin)
        for axis, rest in later.items():
            self[axis].move(*rest, queue=True)
        return motion

    def start_recording(self, name: str = "", repeats: str = "") -> api.RecorderStatus:
        """Begin a run log; `repeats` names the run whose inputs it plays again."""
        return self._call(api.StartRecording(name=name, repeats=repeats), api.RecorderStatus)

    def stop_recording(self) -> api.RecorderStatus:
        """Close the run log; returns its path and how many rows it holds."""
        return self._call(api.StopRecording(), api.RecorderStatus, timeout_s=30.0)

    def note(self, text: str) -> api.RecorderStatus:
        """Write a note into the run log."""
        return self._call(api.AddNote(text=text), api.RecorderStatus)

    def record_last(self, seconds: float = 60.0) -> api.RecorderStatus:
        """Write the last seconds into a log; return its path as `last`."""
        params = api.RecordLast(seconds=seconds)
        return self._call(params, api.RecorderStatus, timeout_s=60.0)

    def take_control(self, name: str, lease_s: float = 10.0) -> api.Control:
        """Take or renew exclusive control; every call of this client renews it, too.

        If you send nothing for `lease_s` while the bench is armed, the daemon disarms it. If
        another client has armed the bench, you cannot take control: disarm it first.
        """
        self._renewal.end()
        self._leased = False
        control = self._call(api.TakeControl(name=name, lease_s=lease_s), api.Control)
        self._conversation.lease = control.lease
        return control

    def release_control(self) -> api.Control:
        """Release exclusive control."""
        self._renewal.end()
        control = self._call(api.ReleaseControl(), api.Control)
        self._conversation.lease = ""
        return control

    @contextlib.contextmanager
    def armed(self) -> Iterator[None]:
        """Arm for the duration of the block; disarm at its end, after an exception, after ctrl-C.

        SIGTERM and SIGHUP disarm too, unless the program handles them itself. If the program is
        killed, the daemon disarms when the lease has lapsed.
        """
        refused = False
        with ended_by_signals():
            try:
                try:
                    self.arm()
                except Refused:
                    # Somebody else may have armed it; that is not ours to end.
                    refused = True
                    raise
                yield
                self.disarm()
            except BaseException:
                # Nor is it where we know that it was stopped: somebody else may use it by now.
                may_be_ours = (self._may_be_armed or self._leased) and not refused
                if may_be_ours and not self._conversation.lapsed:
                    self.disarm_after_an_error()
                raise

    def disarm_after_an_error(self) -> None:
        """Disarm, whatever interrupts it; no error is raised: the one before is what counts."""
        with contextlib.suppress(SmadError):
            while True:
                try:
                    self.disarm()
                except (KeyboardInterrupt, SystemExit):
                    # Whoever presses ctrl-C twice wants it stopped all the more.
                    continue
                return

    @contextlib.contextmanager
    def in_control(
        self, name: str, lease_s: float = 10.0, *, renewed: bool = True
    ) -> Iterator[None]:
        """Keep exclusive control for the duration of the block; raises NotInControl.

        The lease is renewed in the background; without `renewed`, only by this client's calls. If
        the program is killed inside the block, the daemon disarms after `lease_s`. So it does after
        a block that armed the bench and does not know that it is disarmed.
        """
        self.take_control(name, lease_s)
        if renewed:
            self._control_lease_s = lease_s
            self._renewal.begin(self._conversation.lease, lease_s)
        try:
            yield
        finally:
            self._control_lease_s = None
            if self._may_be_armed:
                # Only the end of the lease is sure to disarm it: no call may renew it any more.
                self._renewal.end()
                self._conversation.lease = ""
            else:
                self.release_control()

    @contextlib.contextmanager
    def record(self, name: str = "") -> Iterator[api.RecorderStatus]:
        """Record for the duration of the block; for a killed program, until its lease lapses."""
        try:
            status = self.start_recording(name)
        except Refused:
            # Somebody else may be recording; that is not ours to end.
            raise
        except BaseException:
            # Ctrl-C, or no answer: it may have begun.
            with contextlib.suppress(SmadError):
                self.stop_recording()
            raise
        try:
            yield status
        finally:
            self.stop_recording()

    def _ended(self, motion: api.Motion) -> None:
        if motion.armed:
            if self._conversation.lease:
                self._conversation.lapsed = not (self.status()).control.yours
            return
        self._may_be_armed = False
        # Nothing of ours is armed: somebody else may clear the fault and begin anew.
        if self._leased:
            self._return_lease()
