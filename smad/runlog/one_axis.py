"""One axis of a log of several as a log of its own, for all that reads logs of one axis."""

from pathlib import Path

import msgspec
from mcap import records

from smad.config import config_to_toml, parse_config
from smad.errors import RunLogError
from smad.runlog.header import RunHeader
from smad.runlog.mcap_file import CHANNEL_IDS, pack
from smad.runlog.reader import read_run
from smad.runlog.scan import Damage, Message, scan
from smad.runlog.schema import TOPICS, Row, row_topic
from smad.runlog.writer import END_METADATA_NAME, create_log


def extract(path: str | Path, axis: str) -> Path:
    """Write the samples of one axis, with all events, to a new log; return its path.

    The configuration in its header is that of the axis. It stands beside `path`, with the name of
    the axis in its own. Without an axis the log is used as it is. Raises RunLogError
    when the log has no such axis or the new one cannot be written.
    """
    path = Path(path)
    if not axis:
        return path
    target = path.with_name(f"{path.stem}.{axis}{path.suffix}")
    run = read_run(path, axis=axis)
    ids = {row_topic(axis): CHANNEL_IDS[Row]}
    ids |= {topic: CHANNEL_IDS[kind] for kind, topic in TOPICS.items() if kind is not Row}
    mcap, file = create_log(target, _header_of(run.header, axis))
    numbers: dict[int, int] = {}
    count = 0
    try:
        with file, path.open("rb") as source:
            for item in scan(source, path.stat().st_size, Damage()):
                if isinstance(item, records.Channel) and item.topic in ids:
                    numbers[item.id] = ids[item.topic]
                elif isinstance(item, records.Metadata) and item.name == END_METADATA_NAME:
                    mcap.write_metadata(item.name, item.metadata)
                elif isinstance(item, Message) and item.channel_id in numbers:
                    number = numbers[item.channel_id]
                    mcap.add(pack(number, count, item.time_ns, item.body))
                    count += 1
            mcap.finish()
    except OSError as error:
        target.unlink(missing_ok=True)
        raise RunLogError(
            f"cannot write {target}: {error.strerror}", action="free some space or name another"
        ) from error
    return target


def _header_of(header: RunHeader, axis: str) -> RunHeader:
    prefix = f"{axis}."
    configuration = header.configuration
    if configuration:
        config = parse_config(configuration).by_axis()[axis]
        configuration = config_to_toml(msgspec.structs.replace(config, axes=(), segments=()))
    return msgspec.structs.replace(
        header,
        axes=(),
        configuration=configuration,
        gains={n.removeprefix(prefix): v for n, v in header.gains.items() if n.startswith(prefix)},
        board={n.removeprefix(prefix): v for n, v in header.board.items() if n.startswith(prefix)},
        extra={**header.extra, "axis": axis},
    )
