"""The diagnosis of a unit: its map and its runs make a declared simulator."""

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import msgspec

from smad.diagnosis import Answer
from smad.diagnosis.places.bare import INPUT
from smad.diagnosis.plant import Effect, EffectParameter
from smad.fmi.errors import FmiError
from smad.fmi.map_file import Map, read_map
from smad.fmi.model import UnitModel
from smad.fmi.unit_file import UnitFile, open_unit
from smad.progress import Say, silent
from smad.simulators.asking import diagnose
from smad.simulators.by_map import tables_by_map
from smad.simulators.columns import Table, span_of
from smad.simulators.declare import Simulator
from smad.simulators.planning import Plan, plan
from smad.units import spelt

_SIGN_OF_RANGE = 0.01
"""Of what a term goes with: beside its whole range tanh is then as steep as a sign."""


def diagnose_unit(
    fmu: Path, map_path: Path, runs: Any, *, good: Any = (), hold_out: Any = (), **options: Any
) -> Answer:
    """Where a unit and the runs disagree, in one process unless more are asked for.

    `options` are others of `smad.simulators.diagnose`, but for windows, which the map has. Raises
    FmiError for a unit or a map that cannot be used.
    """
    mapped = read_map(map_path)
    declared, groups = declare_unit(open_unit(fmu), mapped, runs, good, hold_out)
    fit, good_runs, held_out = groups
    options["processes"] = options.get("processes") or 1
    options["window_s"] = _window_s(mapped)
    return diagnose(fit, declared, good=good_runs, hold_out=held_out, **options)


def plan_unit(
    fmu: Path, map_path: Path, inputs: Any, *, within_s: float = 5.0, progress: Say = silent
) -> Plan:
    """What runs with these inputs would show of a unit; as `smad.simulators.plan`."""
    mapped = read_map(map_path)
    declared, (tables,) = declare_unit(open_unit(fmu), mapped, inputs, measured=False)
    return plan(tables, declared, window_s=_window_s(mapped), within_s=within_s, progress=progress)


def declare_unit(
    unit: UnitFile, mapped: Map, *groups: Any, measured: bool = True
) -> tuple[Simulator, list[list[Table]]]:
    """The unit as a simulator, with the runs of each group by the columns that the map names.

    Raises FmiError for a map that does not fit the unit, SimulatorError for a run that does not.
    """
    tables = tables_by_map(groups, mapped, mapped.inputs, mapped.channels, measured=measured)
    mapped = _with_signs(mapped, [t for group in tables for t in group])
    replay = UnitModel(unit, mapped)
    rows = {**mapped.inputs, **mapped.channels}
    channels = mapped.channels.items()
    declared = Simulator(
        function=replay,
        name=mapped.name or unit.described.modelName,
        version=str(unit.described.guid),
        parameters=tuple(
            row.declared(name, row.unit, _start_of(unit, row.variable))
            for name, row in mapped.parameters.items()
        ),
        effects=tuple(_terms(mapped)),
        units={name: spelt(row.unit) for name, row in rows.items()},
        noise={name: row.noise for name, row in channels if not math.isnan(row.noise)},
        quanta={name: row.quantum for name, row in channels if not math.isnan(row.quantum)},
        ranges={name: (row.low, row.high) for name, row in rows.items() if row.ranged},
        transducers=("gain", "zero", "lag"),
        lag_s=None if math.isnan(mapped.lag_s) else mapped.lag_s,
        shortest_s=mapped.shortest_s,
        pause=replay.pause,
    )
    return declared, tables


def _window_s(mapped: Map) -> float | None:
    """The length of windows, None if it is to be chosen; whole runs where no channel is a start."""
    starts = any(isinstance(of, str) for of in mapped.start.values())
    return mapped.window_s if starts else 0.0


def _start_of(unit: UnitFile, variable: str) -> float | None:
    start = unit.variables[variable].start
    return None if start is None else float(start)


def _with_signs(mapped: Map, tables: Sequence[Table]) -> Map:
    """The map with a width of each *sign*: a share of the range of what it goes with."""
    terms = dict(mapped.terms)
    for name, term in terms.items():
        if not term.of or term.shape != "sign" or not math.isnan(term.span):
            continue
        row = {**mapped.inputs, **mapped.channels}[term.of]
        columns = [t.columns[term.of] for t in tables if term.of in t.columns]
        if not row.ranged and not columns:
            raise FmiError(
                f"{term.of} has no range, and no run has its column",
                action=f"give low and high of it in the map, or span of terms.{name}",
            )
        written = [t.written[term.of] for t in tables if term.of in t.written]
        low, high = (row.low, row.high) if row.ranged else span_of(columns, written)
        terms[name] = msgspec.structs.replace(term, span=_SIGN_OF_RANGE * (high - low))
    return msgspec.structs.replace(mapped, terms=terms)


def _terms(mapped: Map) -> list[Effect]:
    effects = []
    drives = {row.variable: f"{INPUT}{name}" for name, row in mapped.inputs.items()}
    for name, term in mapped.terms.items():
        size = EffectParameter(
            name="size", unit=term.unit, typical=term.typical, low=term.low, high=term.high
        )
        f = {"power": "", "sign": "tanh", "deadband": "deadband"}[term.shape]
        raised = f"^{term.power:g}" if term.shape == "power" else ""
        factor = f"{f}(({term.of} − {term.zero:g})/{term.width:g}){raised}" if term.of else "1"
        effects.append(
            Effect(
                name=name,
                title=term.title,
                parameters=(size,),
                signals=(),
                equation=f"{term.variable} += size · {factor}",
                places=(term.place or drives.get(term.variable, f"unit's {term.variable}"),),
            )
        )
    return effects
