"""Model files: a parameter set, what differs from it, the effects and the laws of a bench."""

from __future__ import annotations

import json
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from math import isfinite
from pathlib import Path
from typing import Any, TypedDict

from sim_device.plant.constants import VARIANTS
from sim_device.plant.covariance import Covariance, plain, read_covariance, toml_lines
from sim_device.plant.effects.registry import Resolved, resolve
from sim_device.plant.errors import ModelError, ParameterError
from sim_device.plant.law_file import laws_as_tables, laws_as_toml, laws_from_tables
from sim_device.plant.laws import Law
from sim_device.plant.parameters import BUILT_IN, ParameterSet, load_parameters
from sim_device.plant.textfile import TextFileError, beside, parsed, quoted

_ARRAYS = {"laws", "covariance"}
_KEYS = {"format", "base", "variant", "overrides", "mounting", "effects", "note"} | _ARRAYS
MOUNTING = {
    "side_resistance": "by what share spring Y has more resistance than spring X",
    "displacement_zero_mm": "what the encoder reads at the middle of the stroke",
}
"""How a bench was put together. A diagnosis refits it; the simulated bench is put together evenly,
with its encoder at zero, and leaves it out."""
FORMAT = "smad-model-1"


class Physics(TypedDict):
    """What a plant takes of a model, by the names of its arguments."""

    parameters: ParameterSet
    variant: str
    effects: Resolved
    laws: tuple[Law, ...]


@dataclass(frozen=True)
class Model:
    """A model of the bench. It travels whole: what simulates one takes `**model.physics`.

    `effects` are resolved, `base` names the parameter file that the model starts from (empty: none
    does), `overrides` (SI) are what differs from it; `mounting` has entries of MOUNTING.
    `covariance` is over names of `quantities`, None where it is not known.
    """

    parameters: ParameterSet
    variant: str = "extended"
    effects: Resolved = field(default_factory=dict)
    base: str = ""
    overrides: dict[str, float] = field(default_factory=dict)
    note: str = ""
    mounting: dict[str, float] = field(default_factory=dict)
    laws: tuple[Law, ...] = ()
    covariance: Covariance | None = None

    @property
    def physics(self) -> Physics:
        """The part that a plant simulates; mounting and covariance are for a diagnosis."""
        return Physics(
            parameters=self.parameters, variant=self.variant, effects=self.effects, laws=self.laws
        )

    def with_effects(self, more: Mapping[str, Mapping[str, float]]) -> Model:
        """Return the model with further effects; each replaces the model's of the same name.

        Raises EffectError.
        """
        return replace(self, effects={**self.effects, **resolve(more)})


def built_in(source: str | Path) -> Model:
    """Return the model of a parameter set alone: a built-in one by name, or a parameter file.

    Raises ParameterError.
    """
    return Model(load_parameters(source), base=str(source))


def write_model(path: str | Path, model: Model) -> None:
    """Write a model whole, as a file that needs no parameter file beside it.

    Raises what `read_model` raises; nothing is written then.
    """
    base, overrides = model.base, model.overrides
    if base not in BUILT_IN:
        base = "A"
        of_base = load_parameters(base)
        values = model.parameters
        overrides = {name: values[name] for name in values.names if values[name] != of_base[name]}
    save_model(
        path,
        base=base,
        variant=model.variant,
        overrides=overrides,
        effects=model.effects,
        mounting=model.mounting,
        laws=model.laws,
        covariance=model.covariance,
        note=model.note,
    )


def quantities(model: Model) -> dict[str, float]:
    """All values of a model by the names that a covariance uses, SI."""
    values = {f"parameters.{name}": model.parameters[name] for name in model.parameters.names}
    for name, strengths in model.effects.items():
        values |= {f"effects.{name}.{key}": value for key, value in strengths.items()}
    for law in model.laws:
        values |= {n: t.coefficient for n, t in zip(law.names, law.terms, strict=True)}
    return values | {f"mounting.{name}": model.mounting.get(name, 0.0) for name in MOUNTING}


def read_model(path: str | Path) -> Model:
    """Read a model file.

    Keys: format (must be "smad-model-1"), base (a built-in set or a parameter file, relative to
    the model file), variant, overrides (name to SI value), mounting (of MOUNTING, name to value),
    effects (name to parameters), laws (see `law_file`), covariance (names, and matrix as rows),
    note.
    Raises ModelError for the file itself, ParameterError and EffectError for what it asks for.
    """
    path = Path(path)
    raw = _decode(path)
    if raw.get("format") != FORMAT:
        named = raw.get("format")
        wrong = "it has no format" if named is None else f"format {named!r} is not {FORMAT!r}"
        raise ModelError(
            f"{path.name} is not a model file: {wrong}; "
            "smad gap diagnose --apply writes one, and smad gap apply makes one of a verdict"
        )
    unknown = sorted(set(raw) - _KEYS)
    if unknown:
        raise ModelError(
            f"{path.name}: unknown key {unknown[0]!r}; known are {', '.join(sorted(_KEYS))}"
        )
    variant = raw.get("variant", "extended")
    if variant not in VARIANTS:
        raise ModelError(f"{path.name}: variant {variant!r} is not one of {', '.join(VARIANTS)}")
    base = str(raw.get("base", "A"))
    overrides = _table(path, raw, "overrides")
    effects = _table(path, raw, "effects")
    for name, values in effects.items():
        if not isinstance(values, Mapping):
            raise ModelError(f"{path.name}: effects.{name} is {values!r}, not a table of values")
    mounting = _table(path, raw, "mounting")
    for name, value in mounting.items():
        if name not in MOUNTING:
            raise ModelError(f"{path.name}: unknown mounting.{name}; known are {sorted(MOUNTING)}")
        if isinstance(value, bool) or not isinstance(value, int | float) or not isfinite(value):
            raise ModelError(f"{path.name}: mounting.{name} is {value!r}, not a number")
    source = base if base in BUILT_IN else beside(path, base) or base
    try:
        parameters = load_parameters(source)
    except ParameterError as error:
        raise ParameterError(f"{path.name}: base", str(error)) from None
    model = Model(
        parameters.replace(**overrides),
        variant,
        resolve(effects),
        base,
        overrides,
        str(raw.get("note", "")),
        {name: float(value) for name, value in mounting.items()},
        _laws(path, raw),
    )
    if "covariance" not in raw:
        return model
    table = _table(path, raw, "covariance")
    try:
        covariance = read_covariance(table, quantities(model))
    except ModelError as error:
        raise ModelError(f"{path.name}: {error}") from None
    return replace(model, covariance=covariance)


def save_model(
    path: str | Path,
    *,
    base: str = "A",
    variant: str = "extended",
    overrides: Mapping[str, float] | None = None,
    effects: Mapping[str, Mapping[str, float]] | None = None,
    mounting: Mapping[str, float] | None = None,
    laws: Sequence[Law] = (),
    covariance: Covariance | None = None,
    note: str = "",
) -> None:
    """Write a model file (TOML, or JSON if the name ends so) and check that it can be read.

    Raises what `read_model` raises; nothing is written then.
    """
    path = Path(path)
    raw: dict[str, Any] = {"format": FORMAT, "base": base, "variant": variant}
    if note:
        raw["note"] = note
    raw["overrides"] = {name: float(value) for name, value in (overrides or {}).items()}
    if mounting:
        raw["mounting"] = {name: float(value) for name, value in mounting.items()}
    raw["effects"] = resolve(effects or {})
    if laws:
        raw["laws"] = laws_as_tables(laws)
    if covariance is not None:
        raw["covariance"] = plain(covariance)
    text = json.dumps(raw, indent=2) + "\n" if path.suffix == ".json" else _toml(raw)
    trial = path.with_name(f".{path.name}.new{path.suffix}")
    trial.write_text(text, encoding="utf-8")
    try:
        read_model(trial)
        trial.replace(path)
    finally:
        trial.unlink(missing_ok=True)


def _toml(raw: Mapping[str, Any]) -> str:
    tables = ("overrides", "mounting")
    lines = [
        f"{key} = {quoted(raw[key])}" for key in raw if key not in (*tables, "effects", *_ARRAYS)
    ]
    for table in (t for t in tables if t in raw):
        lines += ["", f"[{table}]", *(f"{name} = {value!r}" for name, value in raw[table].items())]
    for name, values in raw["effects"].items():
        lines += ["", f"[effects.{name}]"]
        lines += [f"{key} = {value!r}" for key, value in values.items()]
    lines += laws_as_toml(raw.get("laws", ()))
    if "covariance" in raw:
        lines += ["", *toml_lines(raw["covariance"])]
    return "\n".join(lines) + "\n"


def _decode(path: Path) -> dict[str, Any]:
    try:
        if path.suffix == ".json":
            raw = parsed(path, "JSON", _json)
        else:
            raw = parsed(path, "TOML", tomllib.loads)
    except TextFileError as error:
        raise ModelError(f"{path} {error}; give a model file, TOML or JSON") from None
    if not isinstance(raw, dict):
        raise ModelError(f"{path.name} holds {type(raw).__name__}, not a table")
    return raw


def _json(text: str) -> Any:
    raw = json.loads(text)
    # JSON can name half a character, which no file, terminal or log can hold. Raises ValueError.
    json.dumps(raw, ensure_ascii=False).encode("utf-8")
    return raw


def _laws(path: Path, raw: Mapping[str, Any]) -> tuple[Law, ...]:
    try:
        return laws_from_tables(raw.get("laws", []))
    except ModelError as error:
        raise ModelError(f"{path.name}: {error}") from None


def _table(path: Path, raw: Mapping[str, Any], key: str) -> dict[str, Any]:
    table = raw.get(key, {})
    if not isinstance(table, dict):
        raise ModelError(f"{path.name}: {key} is {table!r}, not a table")
    return table
