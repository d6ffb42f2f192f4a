"""The C source of one plant: the kernel, and the numbers of a model file."""

from collections.abc import Iterable, Sequence

import numpy as np

from sim_device.plant import kernel as k
from sim_device.plant.fields import ORDERINGS
from sim_device.plant.models import Model
from sim_device.plant.plant import MAX_STEP_S
from sim_device.plant.replay import OUTPUTS
from sim_device.plant.setup import Setup
from smad.arrays import Array
from smad.fmi.library import RECORDS
from smad.fmi.to_c import Program
from smad.fmi.traced import Symbol, trace, written
from smad.fmi.variables import Variable

ENTRIES = (k.rest, k.advance, k.lay_curves)


def kernel_source(
    model: Model, variables: Sequence[Variable], *, fixture: str, cooling: str
) -> str:
    """Return the C of `model`, mounted so: equations, tables, limits, and how constants are made.

    `variables` have inputs, then outputs, then parameters in the order of the parameter set.
    Raises Untranslatable for a construct of the kernel that is new.
    """
    setup = Setup.make(
        model.parameters,
        variant=model.variant,
        fixture=fixture,
        cooling=cooling,
        effects=model.effects,
        laws=model.laws,
    )
    names = [v.name for v in variables]
    outputs = [v.name for v in variables if v.causality == "output"]
    limited = [v for v in variables if v.causality != "output"]
    first = next(n for n, v in enumerate(variables) if v.causality == "parameter")
    places = [k.place_of(k.State, OUTPUTS[name][0]) for name in outputs]
    memory = setup.memory()
    orders = [tuple(model.parameters.names.index(name) for name in pair) for pair in ORDERINGS]
    parts = [
        Program(RECORDS).text(ENTRIES),
        _numbers("MODEL", k.numbers(setup.model)),
        _table("FILM", np.asarray(setup.table)),
        _table("LAWS", setup.laws),
        f"enum {{ RING_ROWS = {setup.ring().shape[0]}, RING_COLUMNS = {k.RING_COLUMNS}, "
        f"MEMORY_ROWS = {len(memory)}, MEMORY_COLUMNS = {k.MEMORY_COLUMNS},\n"
        f"       INPUTS = {sum(v.causality == 'input' for v in variables)}, "
        f"OUTPUTS = {len(outputs)}, PARAMETERS = {len(model.parameters.names)}, "
        f"FIRST_PARAMETER = {first},\n"
        f"       INLET = {names.index('inlet_K')}, AMBIENT = {names.index('ambient_K')}, "
        f"STARTS_AT = {names.index('ambient_K' if cooling == 'air' else 'inlet_K')},\n"
        f"       HAS_LAWS = {int(len(setup.laws) > 0)}, UNIFIED = {int(setup.e.unified > 0.0)} }};",
        f"static const double MAX_STEP = {written(MAX_STEP_S)};",
        f"static const int OUTPUT_PLACE[] = {{{_joined(places)}}};",
        f"static const double OUTPUT_OFF[] = {{{_joined(OUTPUTS[n][1] for n in outputs)}}};",
        _limits(limited),
        f"static const int ORDERS[][2] = {{{_joined(f'{{{a}, {b}}}' for a, b in orders)}}};",
        _constants(model, setup),
    ]
    return "\n\n".join(parts) + "\n"


def _joined(values: Iterable[object]) -> str:
    return ", ".join(map(str, values))


def _numbers(name: str, values: Array) -> str:
    texts = [repr(float(value)) for value in values] or ["0.0"]
    lines = [", ".join(texts[n : n + 6]) for n in range(0, len(texts), 6)]
    return f"static double {name}[] = {{\n    " + ",\n    ".join(lines) + "};"


def _table(name: str, values: Array) -> str:
    rows, columns = values.shape
    size = f"enum {{ {name}_ROWS = {rows}, {name}_COLUMNS = {columns} }};"
    return f"{_numbers(name, values.ravel())}\n{size}"


def _limits(variables: Sequence[Variable]) -> str:
    rows = [
        f'    {{"{v.name}", {_bound(v.low, "-")}, {_bound(v.high, "")}, {written(v.start)}}}'
        for v in variables
    ]
    return (
        "typedef struct { const char *name; double low, high, start; } Limits;\n"
        "static const Limits LIMITS[] = {\n" + ",\n".join(rows) + "};"
    )


def _bound(value: float | None, sign: str) -> str:
    return f"{sign}HUGE_VAL" if value is None else written(value)


def _constants(model: Model, setup: Setup) -> str:
    """The function that makes the kernel's constants and mounting of the parameters `v`."""
    lines, computed, mount = trace(model.parameters, **setup.options)
    # What effects and the choice of the model have set already stays as it is.
    body = [f"    {line}" for line in lines]
    changed = {
        name for name in computed if hasattr(setup.p, name) and isinstance(computed[name], Symbol)
    }
    if setup.p.warms > 0.0 and computed["warms"] == 0.0:
        changed.discard("warming_share")  # effect water_warming
    body += [f"    p->{name} = {written(computed[name])};" for name in computed if name in changed]
    body += [f"    m->{name} = {written(value)};" for name, value in mount.items()]
    return "\n".join(
        ["static void make_constants(const double *v, Constants *p, Mounting *m) {", *body, "}"]
    )
