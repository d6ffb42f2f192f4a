"""New run logs, check-ups and endurance cycles of a folder, taken into the record of its bench."""

import hashlib
from collections.abc import Sequence
from pathlib import Path

import msgspec
from msgspec import Struct

from smad.errors import RunLogError
from smad.experiments.endurance.profile import NAME as ENDURANCE
from smad.experiments.endurance.run import CYCLES_FILE
from smad.health.cycles import rows_of_cycles
from smad.health.errors import HealthError
from smad.health.measure import row_of
from smad.health.record import FILE, Row, Value, append, read
from smad.progress import Say
from smad.runlog.paths import SUFFIX


def collect(folder: Path, verdicts: Sequence[Path], *, say: Say, progress: Say) -> tuple[Row, ...]:
    """Append the rows of what the record does not know yet, and return all that it has then.

    `say` tells which logs are left out.

    Raises HealthError for a folder that is not there and a verdict that cannot be read.
    """
    if not folder.is_dir():
        raise HealthError(f"there is no folder {folder}", action="name that of the run logs")
    sources = {row.source for row in read(folder / FILE)}
    # Check-ups of the queue write theirs beside the output of their items.
    written = (*verdicts, *sorted(folder.glob("queue/item-*.json")))
    # Earlier versions knew a check-up by its path.
    new = [row_of_verdict(path) for path in written if str(path) not in sources]
    rows = [row for row in {row.source: row for row in new}.values() if row.source not in sources]
    rows += rows_of_cycles(folder, sources)
    counted = (folder / CYCLES_FILE).exists()
    for path in sorted(folder.glob(f"*{SUFFIX}")):
        if path.name in sources or ".recovered" in path.name:
            continue
        progress(f"reading {path.name}")
        try:
            row = row_of(path)
        except RunLogError as error:
            say(f"left out: {error}")
            continue
        if row is not None and counted and row.group == ENDURANCE:
            # The statistics of its cycles have counted them.
            row = msgspec.structs.replace(row, cycles=0.0)
        rows += [row] if row is not None else []
    append(folder / FILE, rows)
    return read(folder / FILE)


class _Parameter(Struct, frozen=True):
    name: str
    after: float
    sd: float | None = None


class _Cause(Struct, frozen=True):
    words: str = ""
    name: str = ""
    probability: float = 0.0


class _Signal(Struct, frozen=True):
    signal: str
    unit: str
    floor: float
    raw: float


class _Verdict(Struct, frozen=True):
    outcome: str
    headline: str
    parameters: list[_Parameter] = []
    causes: list[_Cause] = []
    budget: list[_Signal] = []


def row_of_verdict(path: Path) -> Row:
    """Return the row of a check-up's verdict. Raises HealthError."""
    try:
        data = path.read_bytes()
        verdict = msgspec.json.decode(data, type=_Verdict)
    except (OSError, msgspec.MsgspecError) as error:
        raise HealthError(
            f"{path} is not a verdict of a check-up: {error}",
            action="give what smad gap checkup --json wrote",
        ) from None
    values = {f"parameter_{p.name}": Value(p.after, p.sd) for p in verdict.parameters}
    for signal in verdict.budget:
        values[f"gap_{signal.signal}_{signal.unit}"] = Value(signal.raw)
        values[f"floor_{signal.signal}_{signal.unit}"] = Value(signal.floor)
    causes = (f"{cause.name or cause.words} ({cause.probability:.2f})" for cause in verdict.causes)
    return Row(
        unix_s=path.stat().st_mtime,
        kind="checkup",
        # Its content: a path may be written in several ways, and a file be written anew.
        source=f"sha256:{hashlib.sha256(data).hexdigest()}",
        group="checkup",
        values=values,
        words=(verdict.headline, *causes),
    )
