"""A simulator as its author declares it: a function, its parameters, what may be missing."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from sim_device.plant.units import UNITS
from smad.diagnosis.plant import Array, Effect, EffectParameter, Parameter
from smad.simulators.errors import SimulatorError
from smad.simulators.transducers import KINDS
from smad.units import parted_name, unit_of

Replay = Callable[[Array, Mapping[str, Array], Mapping[str, float], Mapping[str, float]], Any]
"""f(t, inputs, values, start) -> outputs by name.

`t` (n,) begins at 0; `inputs` are (n,) each, not to be written to; `values` are the parameters and
effects; `start` has the first reading of each output and its rate (`NAME`, `NAME_rate`).
"""
PRIOR_OF_RANGE = 1.0 / 6.0
"""Share of a parameter's range that is the standard deviation of its prior, unless given."""
_TYPICAL_OF_RANGE = 10.0
_QUANTITIES = {
    **{name: name for name in ("mass", "length", "temperature", "force", "torque", "current",
                               "voltage", "pressure", "power", "angle", "time")},
    **dict.fromkeys(("radius", "diameter", "height", "width", "stroke"), "length"),
    **dict.fromkeys(("delay", "lag", "period"), "time"),
}  # fmt: skip
"""Last words of names, and the quantity that they say."""


@dataclass(frozen=True, kw_only=True)
class Missing:
    """Something that a simulator may lack, 0 when absent, in more words than three numbers.

    `shapes` are further values that say how it acts, name -> (typical, low, high). `places` are the
    places where it acts, by their names in the diagnosis; without them it acts where the function
    uses it.
    """

    typical: float
    low: float = 0.0
    high: float
    title: str = ""
    unit: str = ""
    shapes: Mapping[str, tuple[float, float, float]] = field(default_factory=dict)
    places: tuple[str, ...] = ()


Strength = float | Sequence[float] | Missing
"""Of an effect: its typical size, (typical, low, high), or `Missing`."""


@dataclass(frozen=True, kw_only=True)
class Simulator:
    """What is known of a simulator before any run; made by `simulator`.

    `forces` are inputs that no run has: the function adds them where they act, and they are places.
    `exact` inputs are no places, `observed` columns may be what a law goes with. `felt_at` says
    through which force an input acts, whose place then stands for both. `transducers` are the
    kinds of errors that readings and drives may have; a lag is typically `lag_s`. A run must be
    `shortest_s` long; None for both: as the records ask for. `save` writes a model, `pause` frees
    what processes that are forked must not share.
    """

    function: Replay
    name: str
    version: str = "1"
    parameters: tuple[Parameter, ...]
    effects: tuple[Effect, ...]
    exact: tuple[str, ...] = ()
    observed: tuple[str, ...] = ()
    forces: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    labels: Mapping[str, str] = field(default_factory=dict)
    units: Mapping[str, str] = field(default_factory=dict)
    noise: Mapping[str, float] = field(default_factory=dict)
    quanta: Mapping[str, float] = field(default_factory=dict)
    ranges: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    felt_at: Mapping[str, str] = field(default_factory=dict)
    transducers: Sequence[str] = ()
    lag_s: float | None = None
    shortest_s: float | None = None
    save: Callable[..., None] | None = None
    pause: Callable[[], None] | None = None

    def __post_init__(self) -> None:
        names = [value_name(e, q) for e in self.effects for q in e.parameters]
        names += [p.name for p in self.parameters]
        if twice := sorted({n for n in names if names.count(n) > 1}):
            raise SimulatorError(
                "two values of the simulator have one name", value=twice[0], action="rename one"
            )

    def acts_at(self, name: str) -> str:
        """The place at which an input is felt: its own, or the force that it goes through."""
        return f"input_{self.felt_at.get(name, name)}"

    def unit(self, name: str) -> str:
        """The unit of a column: as declared, else as its name has it."""
        return self.units.get(name, unit_of(name))

    def values(
        self, theta: Mapping[str, float], effects: Mapping[str, Mapping[str, float]]
    ) -> dict[str, float]:
        """Parameters and effects by name as the function takes them, absent effects 0."""
        out = {p.name: float(theta.get(p.name, p.nominal)) for p in self.parameters}
        for e in self.effects:
            of_effect = effects.get(e.name, {})
            for q in e.parameters:
                key = value_name(e, q)
                out[key] = float(of_effect.get(q.name, 0.0 if q.strength else q.typical))
        return out


def value_name(effect: Effect, q: EffectParameter) -> str:
    """What a value of an effect is called in `values`: a strength as its effect."""
    return effect.name if q.strength else q.name


def simulator(
    function: Replay,
    *,
    parameters: Mapping[str, Sequence[float]],
    effects: Mapping[str, Strength] | None = None,
    name: str = "",
    exact: Sequence[str] = (),
    observed: Sequence[str] = (),
    forces: Mapping[str, tuple[float, float]] | None = None,
    units: Mapping[str, str] | None = None,
    noise: Mapping[str, float] | None = None,
    ranges: Mapping[str, tuple[float, float]] | None = None,
    transducers: bool = False,
    shortest_s: float | None = None,
) -> Simulator:
    """Declare a function as a simulator whose gap to recorded runs can be diagnosed.

    `function` is called as f(t, inputs, values, start) (`Replay`) and returns its outputs by name,
    (n,) each; columns of the runs of these names are what was measured, other columns that it reads
    are inputs. `parameters`: name -> (value, low, high); the prior's standard deviation is a sixth
    of the range, or a fourth number. `effects`: what may be missing, 0 when absent: name -> typical
    size, (typical, low, high) or `Missing`. `transducers` adds gain, zero, lag and delay of each
    reading and drive. `noise` is the standard deviation of a sample where no run shows it, `ranges`
    are low and high of inputs that go further than the records. `shortest_s` is how long a run must
    be, by default four correlation times of what is measured, and 8 s at most.

    Raises SimulatorError for numbers that cannot be these.
    """
    adjustable = tuple(_parameter(n, row, units or {}) for n, row in parameters.items())
    title = getattr(function, "__name__", "") or type(function).__name__
    name = name or title.strip("<>")
    causes = tuple(_effect(n, row, name) for n, row in (effects or {}).items())
    if shortest_s is not None and not 0.0 < shortest_s < math.inf:
        raise SimulatorError("shortest_s is not a length", value=shortest_s, action="give s")
    return Simulator(
        function=function,
        name=name,
        parameters=adjustable,
        effects=causes,
        exact=tuple(exact),
        observed=tuple(observed),
        forces=_forces(forces),
        units=dict(units or {}),
        noise=dict(noise or {}),
        ranges=dict(ranges or {}),
        transducers=KINDS if transducers else (),
        shortest_s=shortest_s,
    )


def _parameter(name: str, row: Sequence[float], units: Mapping[str, str]) -> Parameter:
    numbers = _numbers("parameter", name, row, (3, 4), "(value, low, high)")
    value, low, high, *more = numbers
    if not low < high or not low <= value <= high:
        raise SimulatorError(
            f"parameter {name} does not begin within its range",
            value=f"{value:g}, range {low:g} to {high:g}",
            limit="low <= value <= high, low < high",
            action="give (value, low, high)",
        )
    prior = more[0] if more else PRIOR_OF_RANGE * (high - low)
    if not prior > 0.0:
        raise SimulatorError(
            f"parameter {name} has a prior that it cannot leave",
            value=f"standard deviation {prior:g}",
            limit="more than 0",
            action="give a positive one; write what is known into the function",
        )
    unit = units[name] if name in units else unit_of_value(name)
    return Parameter(name=name, unit=unit, nominal=value, low=low, high=high, prior_sd=prior)


def _effect(name: str, row: Strength, function: str) -> Effect:
    cause = row if isinstance(row, Missing) else _missing(name, row)
    if not cause.low <= 0.0 <= cause.high or cause.low == cause.high or cause.typical == 0.0:
        raise SimulatorError(
            f"effect {name} must allow 0, where it is absent, and be typically something else",
            value=f"{cause.low:g} to {cause.high:g}, typically {cause.typical:g}",
            action="give (typical, low, high)",
        )
    unit = cause.unit or unit_of_value(name)
    strength = EffectParameter(
        name="size", unit=unit, typical=cause.typical, low=cause.low, high=cause.high
    )
    shapes = tuple(
        EffectParameter(name=n, unit=unit_of(n), typical=t, low=a, high=b, strength=False)
        for n, (t, a, b) in cause.shapes.items()
    )
    return Effect(
        name=name,
        title=cause.title,
        parameters=(strength, *shapes),
        signals=(),
        places=cause.places or (f"equation of {function} with {name}",),
    )


def unit_of_value(name: str) -> str:
    """The unit that a name ends with. Raises SimulatorError for one that the name contradicts."""
    stem, unit = parted_name(name)
    quantity = _QUANTITIES.get(stem.lower().rpartition("_")[2])
    if quantity and unit in UNITS and UNITS[unit].quantity not in {quantity, "ratio"}:
        fits = [u for u, of in UNITS.items() if of.quantity == quantity]
        raise SimulatorError(
            f"{name} is a {quantity} by its name, and ends with the unit of a "
            f"{UNITS[unit].quantity}",
            value=unit,
            limit=", ".join(fits),
            action=f"name it {stem}_{fits[0].replace(' ', '_')}, or say its unit: "
            f"units={{{name!r}: {fits[0]!r}}}, Missing(unit=…) of an effect",
        )
    return unit


def _missing(name: str, row: float | Sequence[float]) -> Missing:
    if isinstance(row, (int, float)):
        typical = _numbers("effect", name, (row,), (1,), "a number")[0]
        ends = (0.0, _TYPICAL_OF_RANGE * typical)
        return Missing(typical=typical, low=min(ends), high=max(ends))
    typical, low, high = _numbers("effect", name, row, (3,), "(typical, low, high)")
    return Missing(typical=typical, low=low, high=high)


def _forces(ranges: Mapping[str, tuple[float, float]] | None) -> dict[str, tuple[float, float]]:
    form = "{name: (low, high)}"
    if ranges is not None and not isinstance(ranges, Mapping):
        raise SimulatorError(
            "forces are not declared by name",
            value=repr(ranges),
            limit=form,
            action="give the least and the largest of each",
        )
    ends = {n: _numbers("force", n, row, (2,), "(low, high)") for n, row in (ranges or {}).items()}
    return {n: (low, high) for n, (low, high) in ends.items()}


def _numbers(
    kind: str, name: str, row: Sequence[float], counts: tuple[int, ...], form: str
) -> list[float]:
    try:
        numbers = [float(x) for x in row]
    except (TypeError, ValueError):
        numbers = []
    if len(numbers) not in counts or not all(map(math.isfinite, numbers)):
        raise SimulatorError(
            f"{kind} {name} is not {form}", value=repr(row), action=f"give {form}, finite numbers"
        )
    return numbers
