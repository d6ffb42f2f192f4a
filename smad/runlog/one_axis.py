"""One axis of a log of several as a log of its own, for all that reads logs of one axis."""

from pathlib import Path

import msgspec
from mcap import records

from smad.config import config_to_toml, parse_config
from smad.errors import RunLogError
from smad.runlog.header import RunHeader, header_of
from smad.runlog.holes import RECOVERED_METADATA_NAME
from smad.runlog.mcap_file import CHANNEL_IDS, pack
from smad.runlog.reader import read_run
from smad.runlog.scan import Damage, Message, scan
from smad.runlog.schema import TOPICS, Row, row_topic
from smad.runlog.writer import END_METADATA_NAME, create_log

_COPIED_METADATA = (END_METADATA_NAME, RECOVERED_METADATA_NAME)


def extract(path: str | Path, axis: str) -> Path:
    """Write the samples of one axis, with all events, to a new log; return its path.

    The configuration in its header is that of the axis. It stands beside `path`, with the name of
    the axis in its own. Without an axis the log is used as it is. Raises RunLogError
    when the log has no such axis, is not whole, or the new one cannot be written.
    """
    path = Path(path)
    if not axis:
        return path
    target = path.with_name(f"{path.stem}.{axis}{path.suffix}")
    run = read_run(path, axis=axis)
    ids = {row_topic(axis): CHANNEL_IDS[Row]}
    ids |= {topic: CHANNEL_IDS[kind] for kind, topic in TOPICS.items() if kind is not Row}
    mcap, file = create_log(target, _with_configuration(header_of(run.header, axis), axis))
    numbers: dict[int, int] = {}
    count, damage = 0, Damage()
    try:
        with file, path.open("rb") as source:
            for item in scan(source, path.stat().st_size, damage):
                if isinstance(item, records.Channel) and item.topic in ids:
                    numbers[item.id] = ids[item.topic]
                elif isinstance(item, records.Metadata) and item.name in _COPIED_METADATA:
                    mcap.write_metadata(item.name, item.metadata)
                elif isinstance(item, Message) and item.channel_id in numbers:
                    number = numbers[item.channel_id]
                    mcap.add(pack(number, count, item.time_ns, item.body))
                    count += 1
            if damage.notes:
                raise RunLogError(
                    f"{path} is not whole: {damage.notes[0]}",
                    action="end its recording, or split what smad log recover makes of it",
                )
            mcap.finish()
    except (OSError, RunLogError) as error:
        target.unlink(missing_ok=True)
        if isinstance(error, RunLogError):
            raise
        raise RunLogError(
            f"cannot write {target}: {error.strerror}", action="free some space or name another"
        ) from error
    return target


def _with_configuration(header: RunHeader, axis: str) -> RunHeader:
    if not header.configuration:
        return header
    config = parse_config(header.configuration).by_axis()[axis]
    of_axis = config_to_toml(msgspec.structs.replace(config, axes=(), segments=()))
    return msgspec.structs.replace(header, configuration=of_axis)
