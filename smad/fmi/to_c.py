"""The plant's kernel as C: the same operations in the same order, from the Python that numba takes.

The kernel is Python of a restricted kind, all of whose arguments, results and record fields have
types: numbers, records (`sim_device.plant.kernel.layout`), rows and tables of numbers, tuples.
What goes beyond that raises `Untranslatable`, so that a new construct is seen when a unit is made.
"""

from __future__ import annotations

import ast
import inspect
import math
import textwrap
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from types import UnionType
from typing import Annotated, Any, get_args, get_origin, get_type_hints

import numpy as np

from sim_device.plant.kernel.layout import is_array

Function = Callable[..., Any]
_hints = cache(get_type_hints)
"""Every use of a field asks for the types of its record."""

PREAMBLE = """\
#include <math.h>
#include <stdbool.h>
#include <string.h>

typedef struct { double *at; long rows, columns; } Table;
static inline double smad_least(double a, double b) { return b < a ? b : a; }
static inline double smad_most(double a, double b) { return b > a ? b : a; }
static inline long smad_least_long(long a, long b) { return b < a ? b : a; }
static inline long smad_most_long(long a, long b) { return b > a ? b : a; }
"""
_OPERATORS: Mapping[type[ast.AST], str] = {
    ast.Add: "+", ast.Sub: "-", ast.Mult: "*", ast.Div: "/", ast.Mod: "%", ast.BitAnd: "&",
    ast.RShift: ">>", ast.Lt: "<", ast.LtE: "<=", ast.Gt: ">", ast.GtE: ">=", ast.Eq: "==",
    ast.NotEq: "!=", ast.And: "&&", ast.Or: "||", ast.USub: "-", ast.Not: "!",
}  # fmt: skip
_MATH = {"cos", "sqrt", "exp", "pow", "tanh", "copysign", "isfinite", "ceil"}


class Untranslatable(Exception):
    """A construct of the kernel that has no translation; names its place."""


@dataclass(frozen=True)
class Type:
    """A type in C. `name`: of a number or struct. `kind`: value, pointer, row, table or tuple."""

    name: str
    kind: str = "value"
    layout: type | None = None
    parts: tuple[Type, ...] = ()

    @property
    def declared(self) -> str:
        """How a variable of this type is declared, before its name."""
        return f"{self.name} *" if self.kind in ("pointer", "row") else f"{self.name} "


DOUBLE, LONG, BOOL, VOID = Type("double"), Type("long"), Type("bool"), Type("void")
TABLE = Type("Table", "table")


def _is_named_tuple(hint: Any) -> bool:
    return isinstance(hint, type) and issubclass(hint, tuple) and hasattr(hint, "_fields")


@dataclass
class Program:
    """Everything that is reached from some entries, as C.

    `records`: layout of the parameters that are arrays of one record, by name.
    """

    records: Mapping[str, type]
    structs: dict[str, str] = field(default_factory=dict)
    heads: dict[str, str] = field(default_factory=dict)
    bodies: dict[str, str] = field(default_factory=dict)
    _waiting: list[Function] = field(default_factory=list)

    def text(self, entries: Sequence[Function]) -> str:
        """Translate the entries and what they call. Raises Untranslatable."""
        self._waiting += entries
        while self._waiting:
            function = self._waiting.pop()
            name = function.__name__
            if name not in self.bodies:
                self.bodies[name] = ""
                self.bodies[name] = _Body(self, function).text()
        structs, heads = "\n".join(self.structs.values()), "\n".join(self.heads.values())
        return "\n".join([PREAMBLE, structs, heads, *self.bodies.values()])

    def call(self, function: Function) -> Function:
        """Note that a function is called; return it without numba's wrapper."""
        plain: Function = getattr(function, "py_func", function)
        if plain.__name__ not in self.bodies:
            self._waiting.append(plain)
        return plain

    def type_of(self, hint: Any) -> Type:
        """The type in C of an annotation."""
        simple = {float: DOUBLE, int: LONG, bool: BOOL, type(None): VOID, np.float64: DOUBLE}
        if hint in simple:
            return simple[hint]
        if get_origin(hint) is Annotated:
            (kind,) = get_args(hint.__origin__)
            inner = self.type_of(kind)
            return Type(inner.name, "row", inner.layout)
        if get_origin(hint) is UnionType:
            return Type("double", "row")
        if is_array(hint):
            return TABLE
        if get_origin(hint) is tuple:
            return self.tuple_of([self.type_of(part) for part in get_args(hint)])
        if _is_named_tuple(hint):
            fields = _hints(hint)
            parts = "".join(f"{self.type_of(kind).declared}{n}; " for n, kind in fields.items())
            self.structs.setdefault(hint.__name__, f"typedef struct {{ {parts}}} {hint.__name__};")
            return Type(hint.__name__, "named", hint)
        if isinstance(hint, type) and _hints(hint):
            self.record(hint)
            return Type(hint.__name__, "pointer", hint)
        raise Untranslatable(f"type {hint!r}")

    def tuple_of(self, parts: Sequence[Type]) -> Type:
        """The struct of a tuple."""
        name = "tuple_" + "_".join(part.name for part in parts)
        fields = "".join(f"{part.declared}_{n}; " for n, part in enumerate(parts))
        self.structs.setdefault(name, f"typedef struct {{ {fields}}} {name};")
        return Type(name, "tuple", parts=tuple(parts))

    def record(self, layout: type) -> None:
        """Declare the struct of a record, whose fields are all numbers and records of them."""
        if layout.__name__ in self.structs:
            return
        lines = []
        for name, hint in _hints(layout, include_extras=True).items():
            kind = self.type_of(hint)
            size = f"[{hint.__metadata__[0]}]" if kind.kind == "row" else ""
            lines.append(f"    {kind.name} {name}{size};")
        fields = "\n".join(lines)
        self.structs[layout.__name__] = f"typedef struct {{\n{fields}\n}} {layout.__name__};"


class _Body:
    """One function, translated statement by statement."""

    def __init__(self, program: Program, function: Function) -> None:
        plain: Function = getattr(function, "py_func", function)
        self._program = program
        self._name = plain.__name__
        self._globals = plain.__globals__
        source = ast.parse(textwrap.dedent(inspect.getsource(plain)))
        (definition,) = source.body
        assert isinstance(definition, ast.FunctionDef)
        self._definition = definition
        hints = _hints(plain)
        self._arguments = {
            name: program.type_of(program.records.get(name, hints.get(name)))
            for name in inspect.signature(plain).parameters
        }
        self._result = program.type_of(hints["return"])
        self._locals: dict[str, Type] = {}
        self._temporaries = 0

    def text(self) -> str:
        before: dict[str, Type] = {}
        while True:
            # What a later line assigns may widen what an earlier one declared.
            self._temporaries = 0
            lines = self._block(self._definition.body, "    ")
            if self._locals == before:
                break
            before = dict(self._locals)
        arguments = ", ".join(f"{t.declared}{name}" for name, t in self._arguments.items())
        head = f"static {self._result.declared}k_{self._name}({arguments})"
        self._program.heads[self._name] = head + ";"
        declared = [
            f"    {kind.declared}{name};"
            for name, kind in self._locals.items()
            if name not in self._arguments
        ]
        return "\n".join([head + " {", *declared, *lines, "}", ""])

    def _fail(self, node: ast.AST) -> Untranslatable:
        return Untranslatable(f"{self._name}: {ast.unparse(node)}")

    # Statements.

    def _block(self, statements: Sequence[ast.stmt], indent: str) -> list[str]:
        return [line for each in statements for line in self._statement(each, indent)]

    def _statement(self, node: ast.stmt, indent: str) -> list[str]:
        match node:
            case ast.Expr(value=ast.Constant()) | ast.Pass():
                return []
            case ast.Expr(value=ast.Call() as call):
                return [f"{indent}{self._expression(call)[0]};"]
            case ast.Return(value=None):
                return [f"{indent}return;"]
            case ast.Return(value=value) if value is not None:
                return [f"{indent}return {self._expression(value)[0]};"]
            case ast.Break():
                return [f"{indent}break;"]
            case ast.Continue():
                return [f"{indent}continue;"]
            case ast.If(test=test, body=body, orelse=otherwise):
                lines = [f"{indent}if ({self._expression(test)[0]}) {{"]
                lines += self._block(body, indent + "    ")
                if otherwise:
                    lines += [f"{indent}}} else {{", *self._block(otherwise, indent + "    ")]
                return [*lines, f"{indent}}}"]
            case ast.While(test=test, body=body, orelse=[]):
                inside = self._block(body, indent + "    ")
                return [f"{indent}while ({self._expression(test)[0]}) {{", *inside, f"{indent}}}"]
            case ast.For():
                return self._loop(node, indent)
            case ast.Assign(targets=targets, value=value):
                return self._assign(targets, value, indent)
            case ast.AugAssign(target=target, op=op, value=value):
                return self._assign([target], ast.BinOp(target, op, value), indent)
        raise self._fail(node)

    def _loop(self, node: ast.For, indent: str) -> list[str]:
        match node:
            case ast.For(
                target=ast.Name(id=name),
                iter=ast.Call(func=ast.Name(id="range"), args=bounds),
                orelse=[],
            ):
                ends = [self._expression(bound)[0] for bound in bounds]
            case _:
                raise self._fail(node)
        start, stop, step = {1: ("0", *ends, "1"), 2: (*ends, "1"), 3: tuple(ends)}[len(ends)]
        self._declare(name, LONG)
        count, end = self._temporary(), self._temporary()
        test = ">" if step.lstrip("(").startswith("-") else "<"
        return [
            f"{indent}for (long {count} = {start}, {end} = {stop}; "
            f"{count} {test} {end}; {count} += {step}) {{",
            f"{indent}    {name} = {count};",
            *self._block(node.body, indent + "    "),
            f"{indent}}}",
        ]

    def _assign(self, targets: Sequence[ast.expr], value: ast.expr, indent: str) -> list[str]:
        if isinstance(targets[0], ast.Tuple):
            return self._unpack(targets[0].elts, value, indent)
        text, kind = self._expression(value)
        lines = []
        for target in reversed(targets):
            if isinstance(target, ast.Name):
                self._declare(target.id, kind)
            lines.append(f"{indent}{self._expression(target)[0]} = {text};")
            text = self._expression(target)[0]
        return lines

    def _unpack(self, targets: Sequence[ast.expr], value: ast.expr, indent: str) -> list[str]:
        parts: list[tuple[str, Type]] = []
        lines = []
        if isinstance(value, ast.Tuple):
            for each in value.elts:
                text, kind = self._expression(each)
                temporary = self._temporary()
                lines.append(f"{indent}    {kind.declared}{temporary} = {text};")
                parts.append((temporary, kind))
        else:
            text, kind = self._expression(value)
            temporary = self._temporary()
            lines.append(f"{indent}    {kind.declared}{temporary} = {text};")
            parts = [(f"{temporary}._{n}", part) for n, part in enumerate(kind.parts)]
        if len(parts) != len(targets):
            raise self._fail(value)
        for target, (text, kind) in zip(targets, parts, strict=True):
            if isinstance(target, ast.Name):
                self._declare(target.id, kind)
            lines.append(f"{indent}    {self._expression(target)[0]} = {text};")
        return [f"{indent}{{", *lines, f"{indent}}}"]

    def _temporary(self) -> str:
        self._temporaries += 1
        return f"t_{self._temporaries}"

    def _declare(self, name: str, kind: Type) -> None:
        earlier = self._arguments.get(name) or self._locals.get(name)
        if earlier is None or {earlier, kind} == {LONG, DOUBLE}:
            self._locals[name] = kind if earlier is None else DOUBLE
        elif earlier != kind:
            raise Untranslatable(f"{self._name}: {name} is {earlier.name} and {kind.name}")

    # Expressions: text in C, and type.

    def _expression(self, node: ast.expr) -> tuple[str, Type]:
        match node:
            case ast.Constant(value=value):
                return _constant(value)
            case ast.Name(id=name):
                return self._name_of(name)
            case ast.Attribute():
                return self._attribute(node)
            case ast.Subscript():
                return self._subscript(node)
            case ast.BinOp(left=left, op=op, right=right):
                return self._binary(left, op, right)
            case ast.UnaryOp(op=op, operand=operand):
                text, kind = self._expression(operand)
                return f"({_OPERATORS[type(op)]}{text})", kind
            case ast.BoolOp(op=op, values=values):
                between = f" {_OPERATORS[type(op)]} "
                return f"({between.join(self._expression(v)[0] for v in values)})", BOOL
            case ast.Compare(left=left, ops=ops, comparators=others):
                terms = [self._expression(each)[0] for each in (left, *others)]
                pairs = zip(terms[:-1], ops, terms[1:], strict=True)
                tests = (f"{low} {_OPERATORS[type(op)]} {high}" for low, op, high in pairs)
                return f"({' && '.join(tests)})", BOOL
            case ast.IfExp(test=test, body=body, orelse=otherwise):
                (yes, kind), (no, other) = self._expression(body), self._expression(otherwise)
                kind = DOUBLE if {kind, other} == {LONG, DOUBLE} else kind
                return f"({self._expression(test)[0]} ? {yes} : {no})", kind
            case ast.Tuple(elts=parts):
                texts = [self._expression(part) for part in parts]
                kind = self._program.tuple_of([part for _, part in texts])
                return f"(({kind.name}){{{', '.join(text for text, _ in texts)}}})", kind
            case ast.Call():
                return self._call(node)
        raise self._fail(node)

    def _name_of(self, name: str) -> tuple[str, Type]:
        kind = self._arguments.get(name) or self._locals.get(name)
        if kind is not None:
            return name, kind
        if name not in self._globals:
            raise Untranslatable(f"{self._name}: {name} is read before anything is assigned to it")
        return _constant(self._globals[name])

    def _attribute(self, node: ast.Attribute) -> tuple[str, Type]:
        if isinstance(node.value, ast.Name) and self._globals.get(node.value.id) is math:
            return _constant(getattr(math, node.attr))
        text, kind = self._expression(node.value)
        if kind.layout is None:
            raise self._fail(node)
        inner = self._program.type_of(_hints(kind.layout, include_extras=True)[node.attr])
        if kind.kind == "named":
            return f"{text}.{node.attr}", inner
        place = f"{text}->{node.attr}"
        return (f"(&{place})", inner) if inner.kind == "pointer" else (place, inner)

    def _subscript(self, node: ast.Subscript) -> tuple[str, Type]:
        if isinstance(node.value, ast.Attribute) and node.value.attr == "shape":
            table = self._expression(node.value.value)[0]
            return f"{table}.{'columns' if ast.unparse(node.slice) == '1' else 'rows'}", LONG
        text, kind = self._expression(node.value)
        match kind.kind, node.slice:
            case "table", ast.Tuple(elts=[row, column]):
                indices = (self._expression(each)[0] for each in (row, column))
                return "{0}.at[({1}) * {0}.columns + {2}]".format(text, *indices), DOUBLE
            case "tuple", ast.Constant(value=int(n)):
                return f"{text}._{n}", kind.parts[n]
            case "pointer", ast.Constant(value=0):
                return text, kind
            case "pointer", ast.Slice(lower=ast.expr() as first):
                return f"({text} + {self._expression(first)[0]})", kind
            case "table", ast.Slice(lower=ast.expr() as first, upper=ast.expr() as end):
                begin, stop = self._expression(first)[0], self._expression(end)[0]
                place = f"{text}.at + ({begin}) * {text}.columns"
                size = f"({stop}) - ({begin}), {text}.columns"
                return f"((Table){{{place}, {size}}})", TABLE
            case "table", row if not isinstance(row, ast.Slice):
                place = f"{text}.at + ({self._expression(row)[0]}) * {text}.columns"
                return f"({place})", Type("double", "row")
            case "row", index:
                place = f"{text}[{self._expression(index)[0]}]"
                if kind.layout is None:
                    return place, DOUBLE
                return f"(&{place})", Type(kind.name, "pointer", kind.layout)
        raise self._fail(node)

    def _binary(self, left: ast.expr, op: ast.operator, right: ast.expr) -> tuple[str, Type]:
        (a, kind_a), (b, kind_b) = self._expression(left), self._expression(right)
        if type(op) not in _OPERATORS:
            raise self._fail(ast.BinOp(left, op, right))
        kind = LONG if kind_a == kind_b == LONG else DOUBLE
        if isinstance(op, ast.Div) and kind == LONG:
            return f"((double){a} / (double){b})", DOUBLE
        return f"({a} {_OPERATORS[type(op)]} {b})", kind

    def _call(self, node: ast.Call) -> tuple[str, Type]:
        arguments = [self._expression(each) for each in node.args]
        texts = [text for text, _ in arguments]
        if node.keywords:
            raise self._fail(node)
        if isinstance(node.func, ast.Attribute):
            name = node.func.attr
            if name not in _MATH:
                raise self._fail(node)
            kind = {"isfinite": BOOL, "ceil": LONG}.get(name, DOUBLE)
            return f"{'(long)' if name == 'ceil' else ''}{name}({', '.join(texts)})", kind
        assert isinstance(node.func, ast.Name)
        whole = all(kind == LONG for _, kind in arguments)
        match node.func.id:
            case "abs":
                return f"fabs({texts[0]})", DOUBLE
            case "float":
                return f"((double){texts[0]})", DOUBLE
            case "int":
                return f"((long){texts[0]})", LONG
            case "min" | "max" as which if len(texts) == 2:
                name = {"min": "smad_least", "max": "smad_most"}[which] + ("_long" if whole else "")
                return f"{name}({', '.join(texts)})", LONG if whole else DOUBLE
        target = self._globals.get(node.func.id)
        if _is_named_tuple(target):
            kind = self._program.type_of(target)
            return f"(({kind.name}){{{', '.join(texts)}}})", kind
        if not callable(target):
            raise self._fail(node)
        plain = self._program.call(target)
        kind = self._program.type_of(_hints(plain)["return"])
        return f"k_{plain.__name__}({', '.join(texts)})", kind


def _constant(value: object) -> tuple[str, Type]:
    if isinstance(value, bool):
        return ("true" if value else "false"), BOOL
    if isinstance(value, int):
        return str(value), LONG
    if isinstance(value, float):
        return repr(value), DOUBLE
    raise Untranslatable(f"constant {value!r}")
