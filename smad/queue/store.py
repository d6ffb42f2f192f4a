"""The queue's file: SQLite beside the run logs, each change of state one durable transaction.

`synchronous=EXTRA` with a rollback journal: a commit returns after file, journal and folder are on
the disk, so what was acted upon was written before, also over a power loss.
"""

from __future__ import annotations

import contextlib
import sqlite3
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import msgspec
from msgspec import Struct

from smad.queue.errors import StoreError
from smad.queue.machine import Change
from smad.queue.states import Arming, Item, Snapshot

FILE = "queue.sqlite"
APPLICATION = 0x736D6171
"""Marks the file as ours (SQLite's application_id): "smaq"."""
VERSION = 1
BUSY_S = 10.0
_SCHEMA = """
CREATE TABLE item (id INTEGER PRIMARY KEY AUTOINCREMENT, state TEXT NOT NULL, record TEXT NOT NULL);
CREATE TABLE queue (name TEXT PRIMARY KEY, record TEXT NOT NULL);
CREATE TABLE log (item INTEGER NOT NULL, path TEXT NOT NULL, PRIMARY KEY (item, path));
CREATE TABLE message (id INTEGER PRIMARY KEY AUTOINCREMENT, unix_s REAL NOT NULL,
                      event TEXT NOT NULL, text TEXT NOT NULL, item INTEGER);
"""
MOST_MESSAGES = 1000


class Proposal(Struct, frozen=True, kw_only=True):
    """The first step of an arming: what was shown to a person, under which code, and when."""

    code: str
    made_unix_s: float
    arming: Arming


class Message(Struct, frozen=True, kw_only=True):
    """What happened, as people are told of it."""

    id: int
    unix_s: float
    event: str
    text: str
    item: int | None = None


class Store:
    """The file of one queue. A process may open it often; each call is one transaction.

    Raises StoreError when the file is of a newer version, no queue, damaged, or not writable.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            self._db = sqlite3.connect(
                path, timeout=BUSY_S, isolation_level=None, check_same_thread=False
            )
        except (OSError, sqlite3.Error) as error:
            raise StoreError(
                f"cannot open the queue {path}: {error}", action="check the folder's permissions"
            ) from None
        with self._explained():
            self._db.execute("PRAGMA synchronous=EXTRA")
            self._db.execute("PRAGMA journal_mode=DELETE")
            self._prepare()
        self._identity = self._file_identity()

    @property
    def in_place(self) -> bool:
        """Whether the file that is open still has its name: nobody moved it away or removed it."""
        return self._identity == self._file_identity()

    def _file_identity(self) -> tuple[int, int] | None:
        try:
            status = self.path.stat()
        except OSError:
            return None
        return status.st_dev, status.st_ino

    def close(self) -> None:
        """Close the file."""
        self._db.close()

    def __enter__(self) -> Store:
        return self

    def __exit__(self, *error: object) -> None:
        self.close()

    def snapshot(self) -> Snapshot:
        """Return the queue as it is now."""
        with self._explained(), self._transaction("DEFERRED"):
            return self._read()

    def change(self, decide: Callable[[Snapshot], Change]) -> Change:
        """Let `decide` see the queue, and write what it decides, in one transaction.

        What `decide` raises leaves the queue as it was. Raises StoreError when the change cannot be
        written: then nothing of it was, and nothing may be acted upon.
        """
        with self._explained(), self._transaction("IMMEDIATE"):
            change = decide(self._read())
            self._write(change)
        return change

    def add(self, items: Sequence[Item]) -> tuple[Item, ...]:
        """Append items; their numbers and places are given here, never used again."""
        with self._explained(), self._transaction("IMMEDIATE"):
            last = max((item.position for item in self._read().items), default=0.0)
            added = []
            for offset, item in enumerate(items, 1):
                cursor = self._db.execute(
                    "INSERT INTO item (state, record) VALUES (?, '{}')", (item.state,)
                )
                assert cursor.lastrowid is not None
                numbered = msgspec.structs.replace(
                    item, id=cursor.lastrowid, position=last + offset
                )
                self._write_item(numbered)
                added.append(numbered)
        return tuple(added)

    def propose(self, proposal: Proposal | None) -> None:
        """Keep the first step of an arming; the one before it is void. None: there is none."""
        with self._explained(), self._transaction("IMMEDIATE"):
            self._put("proposal", proposal)

    def proposal(self) -> Proposal | None:
        """Return the first step of an arming, if one waits for its second."""
        with self._explained():
            stored: Proposal | None = self._get("proposal", Proposal)
            return stored

    def add_log(self, item: int, path: str) -> None:
        """Note that an item wrote this run log."""
        with self._explained():
            self._db.execute("INSERT OR IGNORE INTO log (item, path) VALUES (?, ?)", (item, path))

    def logs(self, item: int) -> tuple[str, ...]:
        """Return the run logs that an item wrote, as far as they were noted."""
        with self._explained():
            rows = self._db.execute("SELECT path FROM log WHERE item=? ORDER BY rowid", (item,))
            return tuple(row[0] for row in rows)

    def add_message(self, event: str, text: str, item: int | None, unix_s: float) -> None:
        """Add a message, and forget the oldest beyond a thousand."""
        with self._explained(), self._transaction("IMMEDIATE"):
            self._db.execute(
                "INSERT INTO message (unix_s, event, text, item) VALUES (?, ?, ?, ?)",
                (unix_s, event, text, item),
            )
            self._db.execute(
                "DELETE FROM message WHERE id <= (SELECT max(id) FROM message) - ?",
                (MOST_MESSAGES,),
            )

    def messages(self, after: int = 0) -> tuple[Message, ...]:
        """Return the messages with a number above `after`, oldest first."""
        with self._explained():
            rows = self._db.execute(
                "SELECT id, unix_s, event, text, item FROM message WHERE id > ? ORDER BY id",
                (after,),
            ).fetchall()
        names = ("id", "unix_s", "event", "text", "item")
        return tuple(Message(**dict(zip(names, row, strict=True))) for row in rows)

    def _prepare(self) -> None:
        with self._transaction("IMMEDIATE"):
            (version,) = self._db.execute("PRAGMA user_version").fetchone()
            (application,) = self._db.execute("PRAGMA application_id").fetchone()
            (tables,) = self._db.execute("SELECT count(*) FROM sqlite_master").fetchone()
            if not tables and not version:
                for statement in _SCHEMA.split(";"):
                    self._db.execute(statement)
                self._db.execute(f"PRAGMA application_id={APPLICATION}")
                self._db.execute(f"PRAGMA user_version={VERSION}")
                return
        if application != APPLICATION:
            raise StoreError(
                f"{self.path} is not a queue of smad", action="name another folder, or move it away"
            )
        if version > VERSION:
            raise StoreError(
                f"the queue {self.path} was written by a newer smad",
                value=f"version {version}",
                limit=f"version {VERSION}",
                action="use that smad, or move the file away to begin a new queue",
            )

    def _read(self) -> Snapshot:
        rows = self._db.execute("SELECT record FROM item ORDER BY id").fetchall()
        items = tuple(msgspec.json.decode(row[0], type=Item) for row in rows)
        return msgspec.structs.replace(self._head(), items=items)

    def _head(self) -> Snapshot:
        """The snapshot without its items, which have a table of their own."""
        return self._get("head", Snapshot) or Snapshot()

    def _write(self, change: Change) -> None:
        for item in change.items:
            self._write_item(item)
        head = msgspec.structs.replace(change.after, items=())
        if head != self._head():
            self._put("head", head)

    def _write_item(self, item: Item) -> None:
        self._db.execute(
            "UPDATE item SET state=?, record=? WHERE id=?",
            (item.state, msgspec.json.encode(item).decode(), item.id),
        )

    def _put(self, name: str, record: Struct | None) -> None:
        if record is None:
            self._db.execute("DELETE FROM queue WHERE name=?", (name,))
            return
        self._db.execute(
            "INSERT INTO queue (name, record) VALUES (?, ?) "
            "ON CONFLICT (name) DO UPDATE SET record=excluded.record",
            (name, msgspec.json.encode(record).decode()),
        )

    def _get(self, name: str, kind: type[Any]) -> Any:
        row = self._db.execute("SELECT record FROM queue WHERE name=?", (name,)).fetchone()
        return None if row is None else msgspec.json.decode(row[0], type=kind)

    @contextlib.contextmanager
    def _transaction(self, kind: str) -> Iterator[None]:
        self._db.execute(f"BEGIN {kind}")
        try:
            yield
            self._db.execute("COMMIT")
        except BaseException:
            if self._db.in_transaction:
                self._db.execute("ROLLBACK")
            raise

    @contextlib.contextmanager
    def _explained(self) -> Iterator[None]:
        """Tell what SQLite refuses as a StoreError."""
        try:
            yield
        except sqlite3.OperationalError as error:
            raise StoreError(
                f"the queue {self.path} cannot be used: {error}",
                action="make room on its disk, check its permissions; nothing was changed",
            ) from None
        except (sqlite3.DatabaseError, msgspec.MsgspecError) as error:
            raise StoreError(
                f"the queue {self.path} is damaged: {error}",
                action="move it away to begin a new queue; run logs are not concerned",
            ) from None
