"""The diagnosis of a MuJoCo model: its map and its runs make a declared simulator, and a file."""

import json
from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

from smad.diagnosis import Answer
from smad.diagnosis.plant import ModelPoint, Parameter, Uncertainty
from smad.progress import Say, silent
from smad.records.column_names import unit_in
from smad.simulators.asking import diagnose
from smad.simulators.by_map import tables_by_map
from smad.simulators.columns import Table, span_of
from smad.simulators.declare import Simulator, unit_of_value
from smad.simulators.errors import SimulatorError
from smad.simulators.mjcf.library import (
    joint_effects,
    joints_above,
    moving_bodies,
    payload,
    play,
    scale_of,
)
from smad.simulators.mjcf.map_file import MjcfMap, ParameterRow, read_map
from smad.simulators.mjcf.model import MujocoModel, Output, load
from smad.simulators.mjcf.parts import number_of
from smad.simulators.planning import Plan, plan
from smad.simulators.saving import model_text
from smad.simulators.transducers import KINDS
from smad.units import units_for


def diagnose_mjcf(
    model: Path, map_path: Path, runs: Any, *, good: Any = (), hold_out: Any = (), **options: Any
) -> Answer:
    """Where a MuJoCo model and runs disagree; `options` are others of `smad.simulators.diagnose`.

    Raises SimulatorError for a model or a map that cannot be used, MissingPartError without mujoco.
    """
    declared, groups = declare_mjcf(model, map_path, runs, good, hold_out)
    fit, good_runs, held_out = groups
    return diagnose(fit, declared, good=good_runs, hold_out=held_out, **options)


def plan_mjcf(
    model: Path,
    map_path: Path,
    inputs: Any,
    *,
    window_s: float | None = None,
    within_s: float = 5.0,
    progress: Say = silent,
) -> Plan:
    """What runs with these inputs would show of a MuJoCo model; as `smad.simulators.plan`."""
    declared, (tables,) = declare_mjcf(model, map_path, inputs, measured=False)
    return plan(tables, declared, window_s=window_s, within_s=within_s, progress=progress)


def declare_mjcf(
    model: Path, map_path: Path, *groups: Any, measured: bool = True
) -> tuple[Simulator, list[list[Table]]]:
    """The model as a simulator, with the runs of each group by the columns that the map names.

    Raises SimulatorError for a run without an input or, where `measured`, without any channel.
    """
    mapped, spec = read_map(map_path), load(model)
    tables = tables_by_map(
        groups,
        mapped,
        mapped.inputs,
        mapped.channels,
        observed=mapped.observed,
        measured=measured,
    )
    replay = MujocoModel(spec, mapped)
    assumed = [
        f"{n} has no unit in its name or the map; {unit} is assumed"
        for n, unit in replay.assumed_units.items()
    ]
    assumed += replay.notes
    tables = [
        [replace(t, notes=(*t.notes, *assumed, *replay.clipped(t.columns))) for t in group]
        for group in tables
    ]
    every = [t for group in tables for t in group]
    names = (*mapped.inputs, *mapped.channels)
    columns = {n: [t.columns[n] for t in every if n in t.columns] for n in names}
    spans = {n: span_of(c) for n, c in columns.items() if c or n in mapped.inputs}
    return _declared(replay, mapped, model.stem, spans), tables


def _declared(
    replay: MujocoModel, mapped: MjcfMap, name: str, spans: dict[str, tuple[float, float]]
) -> Simulator:
    m = replay.model
    forces: dict[str, tuple[float, float]] = {}
    felt: dict[str, str] = {}
    labels: dict[str, str] = {}
    effects = []
    for joint, number in replay.joints.items():
        driving = _driving(replay, number)
        driven = sum(max(map(abs, spans[n])) * share for n, share in driving.items())
        scale, force = scale_of(m, number, driven), f"{joint}_torque"
        turns = m.jnt_type[number] == replay.hinge
        forces[force] = (-scale.torque, scale.torque)
        labels[force] = f"{'torque' if turns else 'force'} at joint {joint}"
        felt |= dict.fromkeys(driving, force)
        effects += joint_effects(m, joint, scale, f"input_{force}", turns=turns)
    for body in moving_bodies(m) if mapped.payload_at is None else mapped.payload_at:
        above = joints_above(m, number_of(m, "body", body, "payload_at"))
        places = [f"input_{j}_torque" for j, n in replay.joints.items() if n in above]
        effects.append(payload(m, body, places))
    replay.effects = effects
    replay.plays = [
        (x.name, play(x.name, replay.unit(x.name, mapped.channels[x.name]), _whole(x, spans)))
        for x in replay.outputs
        if x.source == "position"
    ]
    units = {n: replay.unit(n, r) for n, r in mapped.inputs.items()}
    units |= {n: replay.unit(n, r) for n, r in mapped.channels.items()}
    units |= {
        n: "N m" if m.jnt_type[replay.joints[n.removesuffix("_torque")]] == replay.hinge else "N"
        for n in forces
    }
    return Simulator(
        function=replay,
        name=mapped.name or name,
        parameters=tuple(_parameter(replay, n, r) for n, r in mapped.parameters.items()),
        effects=(*(e.effect for e in effects), *(e for _, e in replay.plays)),
        exact=tuple(n for n, r in mapped.inputs.items() if r.exact),
        observed=mapped.observed,
        forces=forces,
        felt_at=felt,
        labels=labels,
        units=units,
        transducers=KINDS,
        noise={n: r.noise for n, r in mapped.channels.items() if r.noise is not None},
        shortest_s=mapped.shortest_s,
        save=partial(save, replay),
    )


def _whole(x: Output, spans: Mapping[str, tuple[float, float]]) -> float:
    """A radian, or what a slide goes through in the runs (2 m without), in the reading's unit."""
    low, high = (0.0, 2.0 * x.scale) if x.name not in spans else spans[x.name]
    return abs(x.scale if x.turns else high - low)


def _driving(replay: MujocoModel, joint: int) -> dict[str, float]:
    """Inputs that are a torque at a joint, as a motor's is, with what one unit gives."""
    m, gains = replay.model, {}
    for x in replay.driven:
        if x.column >= m.nu:
            if x.column - m.nu == m.jnt_dofadr[joint]:
                gains[x.name] = abs(x.scale)
        elif m.actuator_trnid[x.column, 0] == joint and replay.is_motor(x.column):
            gain = m.actuator_gainprm[x.column, 0] * m.actuator_gear[x.column, 0]
            gains[x.name] = abs(float(gain) * x.scale)
    return gains


def _parameter(replay: MujocoModel, name: str, row: ParameterRow) -> Parameter:
    unit, named = replay.unit_of_field(name), unit_in(name)
    unit_of_value(name)
    if named and unit in units_for(named) and named != unit:
        raise SimulatorError(
            f"parameters.{name}: its name has another unit than the model's field",
            value=named,
            limit=unit,
            action=f"give its values in {unit}, and name it so",
        )
    return row.declared(name, unit, replay.nominal(name))


def save(
    replay: MujocoModel,
    point: ModelPoint,
    path: Path,
    note: str,
    uncertainty: Uncertainty | None = None,
) -> None:
    """Write a point of a model: as MJCF where its fields have the effects, else as a model file.

    A model file is TOML: the MJCF with the parameters and the effects that its fields have, and in
    tables what no field has: transducers, backlash, laws.
    """
    xml, rest = written(replay, point)
    text = f"<!-- {note.replace('--', '- -')} -->\n{xml}"
    if rest or point.laws:
        head = ["# a MuJoCo model with what no field of MJCF has", f"mjcf = {json.dumps(xml)}"]
        text = model_text(head, note, rest, point, uncertainty)
    path.write_text(text, "utf-8")


def written(replay: MujocoModel, point: ModelPoint) -> tuple[str, dict[str, Mapping[str, float]]]:
    """The MJCF at a point, and the effects that no field of it has."""
    spec = replay.spec.copy()
    fresh = spec.compile()
    values = {n: replay.nominal(n) for n in replay.mapped.parameters} | {
        n: v for n, v in point.theta.items() if n in replay.mapped.parameters
    }
    of_model = {e.effect.name: e for e in replay.effects}
    rest: dict[str, Mapping[str, float]] = {}
    gears = {
        f"{x.name}_gain": x.column for x in replay.driven if x.column < fresh.nu and x.offset == 0.0
    }
    for e in replay.effects:
        sizes = point.effects.get(e.effect.name, {})
        values[e.effect.name] = sizes.get("size", 0.0)
        values |= {
            q.name: sizes.get(q.name, q.typical) for q in e.effect.parameters if not q.strength
        }
    replay.write(fresh, values)
    for name, sizes in point.effects.items():
        if name in gears:
            fresh.actuator_gear[gears[name]] *= 1.0 + sizes.get("g", 0.0)
        elif name not in of_model and any(sizes.values()):
            rest[name] = dict(sizes)
    spec.copy_back(fresh)
    return spec.to_xml(), rest
