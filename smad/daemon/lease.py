"""Exclusive control: one client holds the bench for a while, the others watch, anyone may stop.

Pure: time is an argument. A client is whoever its socket says it is; its name is for messages.
"""

from __future__ import annotations

from msgspec import Struct

from smad.api import Reason
from smad.daemon.errors import Refusal


class Holder(Struct, frozen=True):
    """Who has the bench, and until when (monotonic microseconds)."""

    client: bytes
    name: str
    duration_us: int
    until_us: int


class Lease:
    """At most one holder. Whatever the holder says renews it; silence ends it.

    Who lets a lease lapse, instead of giving it back, has vanished: `lapsed` says so once.
    """

    def __init__(self) -> None:
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

    def heard(self, client: bytes, now_us: int) -> None:
        """Renew the lease of its holder, whatever it said."""
        holder = self.holder(now_us)
        if holder is not None and holder.client == client:
            self._renew(holder, now_us)

    def take(self, client: bytes, name: str, duration_us: int, now_us: int) -> Holder:
        """Give control to `client`, or renew it. Raises Refusal while another one has it."""
        self.check(client, now_us)
        self._holder = Holder(client, name, duration_us, now_us + duration_us)
        return self._holder

    def check(self, client: bytes, now_us: int) -> None:
        """Raise Refusal for anyone but the holder while there is one."""
        holder = self.holder(now_us)
        if holder is None:
            return
        if holder.client != client:
            left_s = (holder.until_us - now_us) / 1e6
            raise Refusal(
                Reason.NOT_IN_CONTROL,
                f"{holder.name} has exclusive control",
                value=f"{left_s:.1f} s left of its lease",
                action="wait, or ask them to release it; disarm and estop work for anyone",
            )

    def _renew(self, holder: Holder, now_us: int) -> None:
        until_us = now_us + holder.duration_us
        self._holder = Holder(holder.client, holder.name, holder.duration_us, until_us)

    def release(self, client: bytes, now_us: int) -> bool:
        """Give control back; return whether `client` had it."""
        holder = self.holder(now_us)
        if holder is None or holder.client != client:
            return False
        self._holder = None
        return True


class DeadMan:
    """Says when the client that armed the bench has been silent too long. Zero: never."""

    def __init__(self, patience_us: int) -> None:
        self.patience_us = patience_us
        self._client: bytes | None = None
        self._heard_us = 0

    def watch(self, client: bytes, now_us: int) -> None:
        """Begin to watch the client that armed."""
        self._client = client
        self._heard_us = now_us

    def heard(self, client: bytes, now_us: int) -> None:
        """Note that a client said something."""
        if client == self._client:
            self._heard_us = now_us

    def forget(self) -> None:
        """The bench is not armed any more."""
        self._client = None

    def expired(self, now_us: int) -> bool:
        """Return whether the watched client has been silent for longer than it may."""
        return (
            self.patience_us > 0
            and self._client is not None
            and now_us - self._heard_us > self.patience_us
        )
