"""A better model as text (TOML): parameters, effects, laws, and what is uncertain of them."""

import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict
from pathlib import Path

from smad.diagnosis.plant import Effect, ModelPoint, Uncertainty
from smad.simulators.declare import Simulator


def save_values(
    declared: Simulator,
    point: ModelPoint,
    path: Path,
    note: str,
    uncertainty: Uncertainty | None,
    *,
    effects: Iterable[Effect],
) -> None:
    """Write a point of a simulator whose values, with their units, are all that can be written."""
    values = {p.name: float(point.theta.get(p.name, p.nominal)) for p in declared.parameters}
    units = {p.name: p.unit for p in declared.parameters}
    units |= {f"{e.name}.{q.name}": q.unit for e in effects for q in e.parameters}
    named = {*values, *(f"{e}.{q}" for e, sizes in point.effects.items() for q in sizes)}
    head = [
        f"# the simulator {declared.name} with what it lacks",
        f"parameters = {_inline({n: repr(v) for n, v in values.items()})}",
        f"units = {_inline({n: json.dumps(u) for n, u in units.items() if u and n in named})}",
    ]
    path.write_text(model_text(head, note, point.effects, point, uncertainty), "utf-8")


def _inline(values: Mapping[str, str]) -> str:
    return f"{{{', '.join(f'{json.dumps(name)} = {text}' for name, text in values.items())}}}"


def model_text(
    head: Sequence[str],
    note: str,
    effects: Mapping[str, Mapping[str, float]],
    point: ModelPoint,
    uncertainty: Uncertainty | None,
) -> str:
    """A model file: what it begins with, the effects, the point's laws, the covariance."""
    quoted = json.dumps
    lines = [*head, f"note = {quoted(note)}"]
    for name, values in effects.items():
        lines += [
            "",
            f"[effects.{quoted(name)}]",
            *(f"{quoted(q)} = {float(v)!r}" for q, v in values.items()),
        ]
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
                lines += ["[[laws.factors]]"]
                lines += [f"{name} = {quoted(value)}" for name, value in asdict(factor).items()]
    if uncertainty is not None and len(uncertainty.names):
        lines += ["", "[uncertainty]", f"names = {quoted(list(uncertainty.names))}",
                  f"covariance = {quoted(uncertainty.covariance.tolist())}"]  # fmt: skip
    return "\n".join(lines) + "\n"
