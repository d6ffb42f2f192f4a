"""The better model as a file: MJCF where its fields have the effects, else a model file.

A model file is TOML: the MJCF with the parameters and the effects that its fields have, and in
tables what no field has: transducers, backlash, laws.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from pathlib import Path

from smad.diagnosis.plant import ModelPoint, Uncertainty
from smad.simulators.mjcf.model import MujocoModel


def saver(replay: MujocoModel) -> Callable[..., None]:
    """What writes a point of a model: `save(point, path, note, uncertainty)`."""

    def save(
        point: ModelPoint, path: Path, note: str, uncertainty: Uncertainty | None = None
    ) -> None:
        xml, rest = written(replay, point)
        text = (
            _comment(xml, note)
            if not rest and not point.laws
            else _file(xml, note, rest, point, uncertainty)
        )
        path.write_text(text, "utf-8")

    return save


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
        given = point.effects.get(e.effect.name, {})
        values[e.effect.name] = given.get("size", 0.0)
        values |= {
            q.name: given.get(q.name, q.typical) for q in e.effect.parameters if not q.strength
        }
    replay.write(fresh, values)
    for name, given in point.effects.items():
        if name in gears:
            fresh.actuator_gear[gears[name]] *= 1.0 + given.get("g", 0.0)
        elif name not in of_model and any(given.values()):
            rest[name] = dict(given)
    spec.copy_back(fresh)
    return spec.to_xml(), rest


def _comment(xml: str, note: str) -> str:
    return f"<!-- {note.replace('--', '- -')} -->\n{xml}"


def _file(
    xml: str,
    note: str,
    effects: Mapping[str, Mapping[str, float]],
    point: ModelPoint,
    uncertainty: Uncertainty | None,
) -> str:
    quoted = json.dumps
    lines = ["# a MuJoCo model with what no field of MJCF has", f"note = {quoted(note)}"]
    lines.append(f"mjcf = {quoted(xml)}")
    for name, values in effects.items():
        lines += ["", f"[effects.{name}]", *(f"{q} = {float(v)!r}" for q, v in values.items())]
    for law in point.laws:
        for term in law.terms:
            lines += [
                "",
                "[[laws]]",
                f"place = {quoted(law.place)}",
                f"term = {quoted(term.name)}",
                f"coefficient = {float(term.coefficient)!r}",
            ]
            for factor in term.factors:
                lines += [
                    "[[laws.factors]]", f"state = {quoted(factor.state)}",
                    f"kind = {quoted(factor.kind)}", f"lag_s = {float(factor.lag_s)!r}",
                    f"low = {float(factor.low)!r}", f"high = {float(factor.high)!r}",
                    f"centre = {float(factor.centre)!r}", f"scale = {float(factor.scale)!r}",
                ]  # fmt: skip
    if uncertainty is not None and len(uncertainty.names):
        lines += ["", "[uncertainty]", f"names = {quoted(list(uncertainty.names))}",
                  f"covariance = {quoted(uncertainty.covariance.tolist())}"]  # fmt: skip
    return "\n".join(lines) + "\n"
