"""The one registry of candidate effects, and how a choice of them becomes the kernel's terms."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping

from firmware_protocol.nearest import instead
from sim_device.plant.effects.cooling import WATER
from sim_device.plant.effects.electrical import ELECTRICAL
from sim_device.plant.effects.mechanics import MECHANICS
from sim_device.plant.effects.phase import PHASE
from sim_device.plant.effects.record import Y_SHARE, Effect
from sim_device.plant.effects.sensing import SENSORS
from sim_device.plant.effects.thermal import THERMAL
from sim_device.plant.errors import EffectError
from sim_device.plant.kernel.layout import places
from sim_device.plant.kernel.model import Effects
from sim_device.written import numbers_by_name

EffectValues = Mapping[str, Mapping[str, float]]
Resolved = dict[str, dict[str, float]]
Terms = dict[str, float]

EFFECTS: tuple[Effect, ...] = (*ELECTRICAL, *SENSORS, *THERMAL, *WATER, *PHASE, *MECHANICS)
_BY_NAME = {effect.name: effect for effect in EFFECTS}

_TERMS = tuple(places(Effects))
# Terms that switch others on: 1 on a side where one of these is not zero.
_SWITCHES = {
    "resists": (
        "coulomb",
        "proportional_friction",
        "pair_drag",
        "tendon_slack",
        "tendon_compliance",
        "pair_stiffness",
    ),
    "adds_strain": ("cold_ends", "r_strain", "elongation", "fatigue_shrink"),
    "late": ("delay_T", "delay_u", "delay_F", "skew_ppm"),
}


def effect(name: str) -> Effect:
    """The entry of that name; EffectError names the known ones otherwise."""
    try:
        return _BY_NAME[name]
    except KeyError:
        hint = instead(name, _BY_NAME, "smad gap effects lists those of each variant")
        raise EffectError(f"effect {name!r} is not in the library; {hint}") from None


def resolve(effects: EffectValues) -> Resolved:
    """Complete and check a choice of effects: every parameter of each gets a value.

    Without any parameter an effect takes its typical values. If some are given, strengths that are
    not given are zero and shapes that are not given are typical. Raises EffectError for an unknown
    name and for a value that is not finite or out of range.
    """
    return {name: _complete(effect(name), values) for name, values in effects.items()}


def from_text(text: str) -> tuple[str, dict[str, float]]:
    """Name and values of an effect written NAME or NAME:PARAMETER=VALUE,…, checked.

    Values are in the units of the registry. Raises EffectError.
    """
    name, _, rest = text.partition(":")
    try:
        values = numbers_by_name(rest)
    except ValueError as error:
        raise EffectError(
            f"effect {text!r}: {error}; write PARAMETER=NUMBER, for example rtd_lag:tau_s=0.5, and"
            " see smad gap effects for names and units"
        ) from None
    resolve({name.strip(): values})
    return name.strip(), values


def from_texts(texts: Iterable[str]) -> dict[str, dict[str, float]]:
    """Values of effects by name, each as of `from_text`. Raises EffectError for one given twice."""
    effects: dict[str, dict[str, float]] = {}
    for name, values in map(from_text, texts):
        if name in effects:
            raise EffectError(
                f"effect {name!r} is given twice; give all its values at once, as "
                "tube_friction:coulomb_N=0.1,proportional=0.05"
            )
        effects[name] = values
    return effects


def _complete(entry: Effect, values: Mapping[str, float]) -> dict[str, float]:
    for name in values:
        if entry.parameter(name) is None:
            hint = instead(name, [parameter.name for parameter in entry.parameters])
            raise EffectError(f"effect {entry.name} has no parameter {name!r}; {hint}")
    chosen = {}
    for parameter in entry.parameters:
        value = values.get(parameter.name)
        if value is None:
            some_strength = any(
                other.is_strength and other.name in values for other in entry.parameters
            )
            value = parameter.typical
            if some_strength and parameter.zero is not None:
                value = parameter.zero
        number = _number(entry.name, parameter.name, value)
        if not math.isfinite(number) or not parameter.low <= number <= parameter.high:
            raise EffectError(
                f"effect {entry.name}: {parameter.name} = {number:g} {parameter.unit} is outside"
                f" {parameter.low:g} to {parameter.high:g} {parameter.unit}"
            )
        chosen[parameter.name] = number
    return chosen


def _number(name: str, key: str, value: object) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise EffectError(f"effect {name}: {key} is {value!r}, not a number; give one")
    try:
        return float(value)
    except OverflowError:
        return math.inf


def check_needs(effects: Resolved, options: Mapping[str, str]) -> None:
    """Raise EffectError for an effect that cannot act in a plant with these options.

    effects: as `resolve` gives them. options: "variant", "cooling", "fixture". Entries whose
    strengths are all zero are let pass.
    """
    for name, values in effects.items():
        entry = effect(name)
        if all(values[q.name] == q.zero for q in entry.parameters if q.is_strength):
            continue
        for option, allowed in entry.needs:
            if options[option] not in allowed:
                raise EffectError(
                    f"effect {name} needs {option} {' or '.join(allowed)}, the plant has"
                    f" {options[option]}; leave the effect out or change the {option}"
                )


def _reads_x(effects: Resolved, terms: Terms) -> float:
    """Share of X's tension in what the force sensor reads, beyond one half.

    The sensor is in the tendon: of what resists the motion it reads the part that acts on Y. Where
    effects have different parts there, the mean of these parts counts.
    """
    shares = [
        0.5 * effects[name][Y_SHARE.name]
        for name, term in (("tube_stiffness", "pair_stiffness"), ("viscous_drag", "pair_drag"))
        if terms[term] != 0.0
    ]
    if terms["coulomb"] != 0.0 or terms["proportional_friction"] != 0.0:
        shares.append(effects["tube_friction"]["sensor_on_x"])
    return sum(shares) / len(shares) - 0.5 if shares else 0.0


def effect_terms(effects: Resolved) -> tuple[Terms, Terms]:
    """The kernel's `Effects` of side X and of side Y for what `resolve` gives; zero without."""
    sides = x, y = dict.fromkeys(_TERMS, 0.0), dict.fromkeys(_TERMS, 0.0)
    for name, values in effects.items():
        of_y = values.get(Y_SHARE.name, 1.0)
        for parameter in effect(name).parameters:
            if parameter.term is not None:
                value = values[parameter.name]
                x[parameter.term] = parameter.on_a_side(value, 2.0 - of_y)
                y[parameter.term] = parameter.on_a_side(value, of_y)
    for side in sides:
        side["pair_stiffness"] = x["tube_stiffness"] + y["tube_stiffness"]
        side["pair_drag"] = 0.5 * (x["drag"] + y["drag"])
        for switch, terms in _SWITCHES.items():
            side[switch] = 1.0 if any(side[term] != 0.0 for term in terms) else 0.0
        side["driver_knee"] = math.expm1(
            -side["driver_sharpness"] * math.log1p(-side["driver_deficit"])
        )
    x["reads_x"] = _reads_x(effects, x)
    return sides
