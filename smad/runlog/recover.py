"""A log that was cut or damaged, rewritten as a whole one."""

from __future__ import annotations

import contextlib
from collections.abc import Mapping
from dataclasses import dataclass
from io import FileIO
from pathlib import Path
from typing import BinaryIO

import msgspec
from mcap import records

from smad.counted import counted
from smad.errors import RunLogError, refused_by_system
from smad.files import replacing
from smad.progress import Share, silent
from smad.runlog import open_logs
from smad.runlog.holes import HOLES, RECOVERED_METADATA_NAME, holes_in, words
from smad.runlog.mcap_file import CHANNEL_IDS, ROWS_METADATA_NAME, McapFile, pack
from smad.runlog.scan import Damage, Message, NotMcapError, scan
from smad.runlog.schema import ROW_TOPIC, TOPICS, axis_of

_MESSAGES_A_REPORT = 10_000
_ID_OF_TOPIC: Mapping[str, int] = {topic: CHANNEL_IDS[record] for record, topic in TOPICS.items()}


@dataclass(frozen=True)
class Recovery:
    """What was saved from a log, and what was not.

    `lost_messages` is what the file's own index tells of damaged chunks; how many rows the
    `unread_bytes` at the end held is not known, at most those of one flush interval after a crash.
    `holes` are the times in s between which the log has no samples; the new log says so, too.
    """

    path: Path
    messages: int
    lost_messages: int
    unread_bytes: int
    notes: list[str]
    holes: list[tuple[float, float]]

    def lines(self) -> list[str]:
        """How much was saved, how much was lost, and the notes."""
        return [
            f"{counted(self.messages, 'message')} to {self.path}",
            f"lost: {counted(self.lost_messages, 'message')} in damaged chunks, "
            f"{self.unread_bytes} bytes",
            *(f"note: {note}" for note in (*self.notes, *words(self.holes))),
        ]


def recovered_path(path: Path) -> Path:
    """Where `recover` writes when nothing else is said: `run.mcap` → `run.recovered.mcap`."""
    return path.with_name(f"{path.stem}.recovered{path.suffix}")


def recover(
    path: str | Path, output: str | Path | None = None, *, progress: Share = silent
) -> Recovery:
    """Write what is readable of the log at `path` to a new file; the old one is left as it is.

    Raises RunLogError when there is nothing to recover: the log is whole or still being written, it
    is no run log, or no message is left. Nothing is written then.
    """
    path = Path(path)
    target = Path(output) if output is not None else recovered_path(path)
    damage = Damage()
    with refused_by_system(RunLogError, f"cannot read {path}", action="check the path"):
        if open_logs.being_written(path):
            raise RunLogError(
                f"{path} is still being written",
                action="end the recording first (smad record stop)",
            )
        size = path.stat().st_size
        source = path.open("rb")
    with source:
        _require_free(target)
        try:
            # Whoever loses power meanwhile must not find half of it under the name of the whole.
            with replacing(target, durable=True) as partial, FileIO(partial, "xb") as file:
                rewrite = _Rewrite(McapFile(file))
                _copy(source, size, damage, rewrite, progress)
                rewrite.finish(path, damage)
                _refuse_if_pointless(path, damage, rewrite)
        except Exception as error:
            _explain(path, target, error)
            raise
    return Recovery(
        path=target,
        messages=rewrite.messages,
        lost_messages=damage.lost_messages,
        unread_bytes=damage.unread_bytes,
        notes=damage.notes,
        holes=rewrite.holes,
    )


def _require_free(target: Path) -> None:
    if target.exists():
        action = "name another file with --output"
        raise RunLogError(f"{target} is there already", action=action)


def _explain(path: Path, target: Path, error: Exception) -> None:
    if isinstance(error, NotMcapError):
        raise RunLogError(
            f"{path} is not a run log: {error.why}",
            action=error.action or "nothing can be recovered from it",
        ) from None
    if isinstance(error, OSError):
        raise RunLogError(
            f"cannot recover {path} to {target}: {error.strerror}",
            action="check the disk and its free space, or name another file with --output",
        ) from error


def _refuse_if_pointless(path: Path, damage: Damage, rewrite: _Rewrite) -> None:
    if not rewrite.messages:
        raise RunLogError(
            f"{path} holds no readable message on {ROW_TOPIC} or beside it",
            action="nothing can be recovered from it",
        )
    if damage.ended_in_order and not damage.notes:
        raise RunLogError(f"{path} is whole", action="use it as it is")


def _copy(source: BinaryIO, size: int, damage: Damage, rewrite: _Rewrite, progress: Share) -> None:
    for count, item in enumerate(scan(source, size, damage)):
        if isinstance(item, Message):
            rewrite.message(item)
        elif isinstance(item, records.Channel):
            rewrite.channel(item)
        elif item.name not in (RECOVERED_METADATA_NAME, ROWS_METADATA_NAME):
            rewrite.metadata(item)
        if count % _MESSAGES_A_REPORT == 0:
            progress(source.tell() / size)
    progress(1.0)


class _Time(msgspec.Struct):
    t_s: float


_decode_time = msgspec.json.Decoder(_Time).decode


class _Rewrite:
    """Puts messages of known topics into a new file, bodies unchanged, numbered afresh."""

    def __init__(self, mcap: McapFile) -> None:
        self.messages = 0
        self._mcap = mcap
        self._ids: dict[int, int] = {}
        self._sequences = dict.fromkeys(_ID_OF_TOPIC.values(), 0)
        self._times: dict[int, list[float]] = {}

    @property
    def holes(self) -> list[tuple[float, float]]:
        """Times without samples, of every axis."""
        return sorted({hole for times in self._times.values() for hole in holes_in(times)})

    def channel(self, channel: records.Channel) -> None:
        if channel.topic in _ID_OF_TOPIC:
            self._ids[channel.id] = _ID_OF_TOPIC[channel.topic]
            if channel.topic == ROW_TOPIC:
                self._times.setdefault(self._ids[channel.id], [])
        elif axis := axis_of(channel.topic):
            self._ids[channel.id] = number = self._mcap.add_axis(axis)
            self._sequences.setdefault(number, 0)
            self._times.setdefault(number, [])

    def metadata(self, metadata: records.Metadata) -> None:
        self._mcap.write_metadata(metadata.name, metadata.metadata)

    def message(self, message: Message) -> None:
        channel_id = self._ids.get(message.channel_id)
        if channel_id is None:
            return
        sequence = self._sequences[channel_id]
        self._sequences[channel_id] = (sequence + 1) & 0xFFFFFFFF
        self._mcap.add(pack(channel_id, sequence, message.time_ns, message.body))
        self.messages += 1
        if channel_id in self._times:
            # What is no row of ours is left to whoever reads the log.
            with contextlib.suppress(msgspec.MsgspecError, UnicodeDecodeError):
                self._times[channel_id].append(_decode_time(message.body).t_s)

    def finish(self, path: Path, damage: Damage) -> None:
        self._mcap.write_metadata(
            RECOVERED_METADATA_NAME,
            {
                "from": path.name,
                "lost_messages": str(damage.lost_messages),
                "unread_bytes": str(damage.unread_bytes),
                "notes": "\n".join(damage.notes),
                HOLES: "\n".join(words(self.holes)),
            },
        )
        self._mcap.finish()
