"""What a map leaves out, from the records: ranges, quanta, noise, a usual lag, widths of signs."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import msgspec

from smad.diagnosis.data.noise import third_difference_sd
from smad.diagnosis.runs import GapRun
from smad.fmi.errors import FmiError
from smad.fmi.map_file import Map
from smad.simulators.columns import (
    LAG_OF_CORRELATION,
    UNMEASURED,
    quantum_of,
    span_of,
    usual_correlation_s,
)

_SIGN_OF_RANGE = 0.01
"""Of what a term goes with: beside its whole range tanh is then as steep as a sign."""


def completed(mapped: Map, runs: Sequence[GapRun]) -> tuple[Map, str]:
    """The map with nothing left out, and in words what was taken from the records.

    Raises FmiError for a range that neither the map nor a run has.
    """
    taken: dict[str, list[str]] = {}

    def filled(table: str, name: str, row: Any) -> Any:
        columns = [c for r in runs if (c := {**r.inputs, **r.outputs}.get(name)) is not None]
        written = [r.written[name] for r in runs if name in r.written]
        given = {f: getattr(row, f) for f in ("low", "high", "quantum", "noise") if hasattr(row, f)}
        lacking = [f for f, v in given.items() if math.isnan(v)]
        if not lacking:
            return row
        if "low" in lacking and not columns:
            raise FmiError(
                f"{table}.{name} has no range, and no run has its column",
                action="give low and high in the map, or runs that have it",
            )
        if "low" in lacking:
            low, high = span_of(columns, written)
            beyond = high - low if table == "channels" else 0.0
            given |= {"low": low - beyond, "high": high + beyond}
        if "quantum" in lacking:
            given["quantum"] = quantum_of(columns)
        if "noise" in lacking:
            noise = third_difference_sd(columns) if columns else 0.0
            given["noise"] = noise or UNMEASURED * (given["high"] - given["low"])
        taken.setdefault(", ".join(lacking), []).append(name)
        return msgspec.structs.replace(row, **given)

    mapped = msgspec.structs.replace(
        mapped,
        inputs={n: filled("inputs", n, r) for n, r in mapped.inputs.items()},
        channels={n: filled("channels", n, r) for n, r in mapped.channels.items()},
    )
    if math.isnan(mapped.lag_s):
        columns = ((r.t_s, y) for r in runs for y in (r.outputs or r.inputs).values())
        lag_s = LAG_OF_CORRELATION * usual_correlation_s(columns)
        mapped = msgspec.structs.replace(mapped, lag_s=lag_s)
        taken["lag_s"] = [f"{lag_s:.2g} s"]
    words = "; ".join(f"{what} of {', '.join(names)}" for what, names in taken.items())
    words = words.replace("lag_s of", "lag_s")
    return _with_signs(mapped), f"taken from the records: {words}" if words else ""


def _with_signs(mapped: Map) -> Map:
    rows = {**mapped.inputs, **mapped.channels}
    terms = {
        n: msgspec.structs.replace(t, span=_SIGN_OF_RANGE * (rows[t.of].high - rows[t.of].low))
        if t.of and t.shape == "sign" and math.isnan(t.span)
        else t
        for n, t in mapped.terms.items()
    }
    return msgspec.structs.replace(mapped, terms=terms)
