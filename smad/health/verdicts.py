"""The row of a check-up, from the JSON that it writes."""

from pathlib import Path

import msgspec
from msgspec import Struct

from smad.health.errors import HealthError
from smad.health.record import Row, Value


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
        verdict = msgspec.json.decode(path.read_bytes(), type=_Verdict)
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
        source=str(path),
        group="checkup",
        values=values,
        words=(verdict.headline, *causes),
    )
