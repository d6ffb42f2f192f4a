"""Exclusive control: one client holds the bench for a while, the others watch, anyone may stop.

Pure: time is an argument, and so is what makes secrets. Whoever knows the secret of a lease holds
it: the name of a client's socket is its own choice, and may be seen again after it has gone.
"""

from collections.abc import Callable, Iterable

import msgspec
from msgspec import Struct

from smad.api import Reason
from smad.daemon.errors import Refusal


class Caller(Struct, frozen=True):
    """Who asks: the name of its socket, the secret of its lease (empty: it has none).

    `behind`: what it asks may have been sent before the last stop. `axes`: those it names.
    """

    client: bytes
    lease: str = ""
    behind: bool = False
    axes: tuple[str, ...] = ()


class Holder(Struct, frozen=True):
    """Who has the bench, and until when (monotonic microseconds)."""

    secret: str
    name: str
    duration_us: int
    until_us: int
    client: bytes = b""
    """The name of the socket that took it."""


class Lease:
    """At most one holder. Whatever the holder says renews it; silence ends it.

    Who lets a lease lapse, instead of giving it back, has vanished: `lapsed` says so once, and
    has to be asked before anything else is.
    """

    def __init__(self, new_secret: Callable[[], str]) -> None:
        self._new_secret = new_secret
        self._holder: Holder | None = None

    def holder(self, now_us: int) -> Holder | None:
        """Return who has control now."""
        holder = self._holder
        return None if holder is None or now_us >= holder.until_us else holder

    def lapsed(self, now_us: int) -> Holder | None:
        """Return who fell silent since the last call, if somebody did."""
        holder = self._holder
        if holder is None or now_us < holder.until_us:
            return None
        self._holder = None
        return holder

    def is_held_with(self, secret: str, now_us: int) -> bool:
        """Return whether `secret` is that of the lease in force."""
        holder = self.holder(now_us)
        return holder is not None and holder.secret == secret

    def heard(self, secret: str, now_us: int) -> None:
        """Renew the lease of its holder, whatever it said."""
        holder = self.holder(now_us)
        if holder is not None and holder.secret == secret:
            self._holder = msgspec.structs.replace(holder, until_us=now_us + holder.duration_us)

    def take(
        self, secret: str, name: str, duration_us: int, now_us: int, client: bytes = b""
    ) -> Holder:
        """Give control, under a new secret, or renew it. Raises Refusal while another has it."""
        if not self.is_held_with(secret, now_us):
            self.check("", now_us)
            secret = self._new_secret()
        self._holder = Holder(secret, name, duration_us, now_us + duration_us, client)
        return self._holder

    def check(self, secret: str, now_us: int) -> None:
        """Raise Refusal for anyone but the holder, if there is one, and for an ended lease."""
        holder = self.holder(now_us)
        if holder is None:
            if secret:
                raise Refusal(
                    Reason.NOT_IN_CONTROL,
                    "your exclusive control has ended",
                    action="take it again (control.take); smad status says what happened",
                )
            return
        if holder.secret != secret:
            left_s = (holder.until_us - now_us) / 1e6
            raise Refusal(
                Reason.NOT_IN_CONTROL,
                f"{holder.name} has exclusive control",
                value=f"{left_s:.1f} s left of its lease",
                action="wait, or ask them to release it; disarm and estop work for anyone",
            )

    def release(self, secret: str, now_us: int) -> bool:
        """Give control back; return whether `secret` was the holder's."""
        if not self.is_held_with(secret, now_us):
            return False
        self._holder = None
        return True


class DeadMan:
    """Knows which client armed each axis, and says when one is silent too long. Zero: never."""

    def __init__(self, patience_us: int) -> None:
        self.patience_us = patience_us
        self._clients: dict[str, bytes] = {}
        """By axis, of those that are armed or about to be."""
        self._heard_us: dict[bytes, int] = {}

    def watch(self, axes: Iterable[str], client: bytes, now_us: int) -> None:
        """Begin to watch the client that arms these axes."""
        self._clients |= dict.fromkeys(axes, client)
        self._heard_us[client] = now_us

    def heard(self, client: bytes, now_us: int) -> None:
        """Note that a client said something."""
        if client in self._heard_us:
            self._heard_us[client] = now_us

    def forget(self, axes: Iterable[str]) -> None:
        """These axes are not armed any more."""
        for axis in axes:
            self._clients.pop(axis, None)
        armed = set(self._clients.values())
        self._heard_us = {who: us for who, us in self._heard_us.items() if who in armed}

    def armed_by(self, axis: str) -> bytes | None:
        """Return the client that armed an axis; None while nobody has."""
        return self._clients.get(axis)

    def expired(self, now_us: int) -> bool:
        """Return whether a client that armed has been silent for longer than it may."""
        if self.patience_us <= 0:
            return False
        return any(now_us - us > self.patience_us for us in self._heard_us.values())
