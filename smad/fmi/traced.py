"""The constants of the kernel as assignments in C, from the functions that compute them.

A unit's parameters can be changed on the importing machine, so what `kernel_constants` and
`mounting` make of them has to be computed there. Both are arithmetic without branches on values:
they are run once with symbols in place of numbers, and each operation becomes one line.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from types import FunctionType, ModuleType, SimpleNamespace
from typing import Any

import numpy as np
from numpy.lib.mixins import NDArrayOperatorsMixin

from sim_device.plant import constants, parameters
from sim_device.plant.parameters import ParameterSet


@dataclass
class Tape:
    """The operations in their order, `double t0 = …;` each."""

    lines: list[str] = field(default_factory=list)

    def symbol(self, text: str) -> Symbol:
        """A new symbol with the value of an expression."""
        name = f"t{len(self.lines)}"
        self.lines.append(f"double {name} = {text};")
        return Symbol(self, name)


_OPERATIONS: dict[np.ufunc, str] = {
    np.add: "{} + {}",
    np.subtract: "{} - {}",
    np.multiply: "{} * {}",
    np.true_divide: "{} / {}",
    np.power: "pow({}, {})",
}


@dataclass(frozen=True, eq=False)
class Symbol(NDArrayOperatorsMixin):
    """A number that is known on the importing machine only."""

    tape: Tape
    name: str

    def __array_ufunc__(self, operation: np.ufunc, method: str, *numbers: object) -> Any:
        """Write an operation down; another one, such as a comparison, raises TypeError."""
        if operation not in _OPERATIONS:
            return NotImplemented
        return self.tape.symbol(_OPERATIONS[operation].format(*map(written, numbers)))


def written(value: object) -> str:
    """A symbol's name, or a number as C has it."""
    return value.name if isinstance(value, Symbol) else repr(float(value))  # type: ignore[arg-type]


def trace(params: ParameterSet, **options: Any) -> tuple[list[str], dict[str, Any], dict[str, Any]]:
    """Return lines in C, and what the kernel's Constants and Mounting are after them, by name.

    The lines read `v[k]`, parameter k in the order of `params.names`. Options are those of
    `kernel_constants`; the temperature of `mounting` is the caller's to fill in.
    """
    tape = Tape()
    values = {name: tape.symbol(f"v[{k}]") for k, name in enumerate(params.names)}
    symbols: Any = _Parameters(values)
    run = _over_symbols(tape)
    kernel_constants = run["kernel_constants"](symbols, **options)
    mounting_options = {key: options[key] for key in ("fixture", "cooling")}
    mount = run["mounting"](symbols, **mounting_options)
    return tape.lines, kernel_constants, mount


class _Parameters:
    """As much of a ParameterSet as the constants read."""

    def __init__(self, values: dict[str, Symbol]) -> None:
        self._values = values
        self.entries = [SimpleNamespace(name=name, value=value) for name, value in values.items()]

    def __getitem__(self, name: str) -> Symbol:
        return self._values[name]


def _over_symbols(tape: Tape) -> dict[str, Callable[..., Any]]:
    """The functions of both modules, with `math` and `float` that take symbols."""

    def of(name: str) -> Callable[[Any], Any]:
        def applied(value: Any) -> Any:
            if isinstance(value, Symbol):
                return tape.symbol(f"{name}({value.name})")
            return getattr(math, name)(value)

        return applied

    symbolic = SimpleNamespace(pi=math.pi, sqrt=of("sqrt"), log=of("log"))
    space: dict[str, Any] = {}
    for module in (parameters, constants):
        space |= vars(module)
    space |= {"math": symbolic, "float": lambda v: v if isinstance(v, Symbol) else float(v)}
    for module in (parameters, constants):
        space |= {
            name: FunctionType(function.__code__, space, name, function.__defaults__)
            for name, function in _functions(module).items()
        }
        for name, function in _functions(module).items():
            space[name].__kwdefaults__ = function.__kwdefaults__
    return space


def _functions(module: ModuleType) -> dict[str, FunctionType]:
    # What is cached (`water_heat_capacity`) reads no parameters and stays as it is.
    return {
        name: value
        for name, value in vars(module).items()
        if isinstance(value, FunctionType) and value.__module__ == module.__name__
    }
