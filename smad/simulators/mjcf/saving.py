"""The better model as a file: MJCF where its fields have the effects, else a model file.

A model file is TOML: the MJCF with the parameters and the effects that its fields have, and in
tables what no field has: transducers, backlash, laws.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path

from smad.diagnosis.plant import ModelPoint, Uncertainty
from smad.simulators.mjcf.model import MujocoModel
from smad.simulators.saving import model_text


def save(
    replay: MujocoModel,
    point: ModelPoint,
    path: Path,
    note: str,
    uncertainty: Uncertainty | None = None,
) -> None:
    """Write a point of a model."""
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
