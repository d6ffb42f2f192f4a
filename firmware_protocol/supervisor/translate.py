"""From the supervisor's Python to portable C99, function by function.

Only the Python that the supervisor's core uses is known: integers, fields of four records, fixed
tables, if, for over a range or a table row, and calls of each other. Whatever else turns up raises
TranslationError with file and line, so that the core cannot grow out of what C can do.

All numbers are int64_t. `//` rounds down in both languages; `%` is not used.
"""

from __future__ import annotations

import ast
import inspect
from collections.abc import Mapping
from dataclasses import dataclass
from enum import IntEnum
from types import ModuleType

from firmware_protocol.supervisor.errors import TranslationError

PREFIX = "smad_sv_"
RECORDS = {
    "Memory": "struct smad_sv_memory *",
    "Measurements": "const struct smad_sv_measurements *",
    "Limits": "const struct smad_sv_limits *",
    "Command": "const struct smad_sv_command *",
    "int": "int64_t ",
}
HELPERS = {"min": "smad_sv_min", "max": "smad_sv_max", "abs": "smad_sv_abs"}
_BINARY: dict[type[ast.operator], str] = {
    ast.Add: "+", ast.Sub: "-", ast.Mult: "*", ast.BitAnd: "&", ast.BitOr: "|", ast.LShift: "<<",
}  # fmt: skip
_COMPARE: dict[type[ast.cmpop], str] = {
    ast.Eq: "==", ast.NotEq: "!=", ast.Lt: "<", ast.LtE: "<=", ast.Gt: ">", ast.GtE: ">=",
}  # fmt: skip
INDENT = "    "


@dataclass(frozen=True)
class Names:
    """What the functions may mention besides their arguments."""

    functions: frozenset[str]
    enums: Mapping[str, type[IntEnum]]
    constants: Mapping[str, int]
    tables: frozenset[str]
    """Names of one-dimensional tables, written `TABLE[index]`."""
    row_tables: frozenset[str]
    """Names of tables of rows, written `for item in TABLE[row]`."""
    function_tables: frozenset[str]


def enum_name(kind: str, member: str) -> str:
    """`BoardState`, `SAFE` → `SMAD_BOARD_STATE_SAFE`."""
    words = "".join("_" + ch if ch.isupper() and n else ch for n, ch in enumerate(kind))
    return f"SMAD_{words.upper()}_{member}"


def functions_of(module: ModuleType) -> list[ast.FunctionDef]:
    """Return the functions that `module` defines, in order."""
    tree = ast.parse(inspect.getsource(module))
    return [node for node in tree.body if isinstance(node, ast.FunctionDef)]


def constants_of(module: ModuleType) -> dict[str, int]:
    """Return the whole-number constants that `module` itself defines, by name."""
    tree = ast.parse(inspect.getsource(module))
    return {
        target.id: getattr(module, target.id)
        for node in tree.body
        if isinstance(node, ast.Assign)
        for target in node.targets
        if isinstance(target, ast.Name) and isinstance(getattr(module, target.id), int)
    }


class Translator:
    """Translates the functions of one module."""

    def __init__(self, module: ModuleType, names: Names) -> None:
        self._file = module.__name__
        self._names = names
        self._locals: list[str] = []

    def prototype(self, function: ast.FunctionDef, *, public: bool) -> str:
        """Return the C declaration, without a semicolon."""
        arguments = []
        for argument in function.args.args:
            kind = argument.annotation
            if not isinstance(kind, ast.Name) or kind.id not in RECORDS:
                raise self._error(argument, "an argument of unknown type")
            arguments.append(RECORDS[kind.id] + argument.arg)
        returns = function.returns
        nothing = isinstance(returns, ast.Constant) and returns.value is None
        storage = "" if public else "static "
        return (
            f"{storage}{'void' if nothing else 'int64_t'} {PREFIX}{function.name}"
            f"({', '.join(arguments)})"
        )

    def definition(self, function: ast.FunctionDef, *, public: bool) -> str:
        """Return the whole C function."""
        arguments = [argument.arg for argument in function.args.args]
        self._locals = []
        body = [node for node in function.body if not _is_docstring(node)]
        lines = self._block(body, 1)
        used = {node.id for node in ast.walk(function) if isinstance(node, ast.Name)}
        head = [f"{INDENT}int64_t {name};" for name in self._locals]
        head += [f"{INDENT}(void){name};" for name in arguments if name not in used]
        text = "\n".join([*head, *lines])
        return f"{self.prototype(function, public=public)}\n{{\n{text}\n}}\n"

    def _block(self, nodes: list[ast.stmt], depth: int) -> list[str]:
        return [line for node in nodes for line in self._statement(node, depth)]

    def _statement(self, node: ast.stmt, depth: int) -> list[str]:
        pad = INDENT * depth
        match node:
            case ast.Assign(targets=[target], value=value):
                return [f"{pad}{self._target(target)} = {self._expression(value)};"]
            case ast.AugAssign(target=target, op=op, value=value) if type(op) in _BINARY:
                symbol = _BINARY[type(op)]
                return [f"{pad}{self._target(target)} {symbol}= {self._expression(value)};"]
            case ast.Return(value=None):
                return [f"{pad}return;"]
            case ast.Return(value=value) if value is not None:
                return [f"{pad}return {self._expression(value)};"]
            case ast.Expr(value=ast.Call() as call):
                return [f"{pad}{self._expression(call)};"]
            case ast.If():
                return self._if(node, depth)
            case ast.For(target=ast.Name(id=name), iter=source, body=body, orelse=[]):
                return self._for(name, source, body, depth)
        raise self._error(node, f"{type(node).__name__} has no counterpart")

    def _if(self, node: ast.If, depth: int) -> list[str]:
        pad = INDENT * depth
        lines = [f"{pad}if ({self._expression(node.test)}) {{", *self._block(node.body, depth + 1)]
        rest = node.orelse
        if len(rest) == 1 and isinstance(rest[0], ast.If):
            following = self._if(rest[0], depth)
            return [*lines, f"{pad}}} else {following[0].strip()}", *following[1:]]
        if rest:
            lines += [f"{pad}}} else {{", *self._block(rest, depth + 1)]
        return [*lines, f"{pad}}}"]

    def _for(self, name: str, source: ast.expr, body: list[ast.stmt], depth: int) -> list[str]:
        pad, inner = INDENT * depth, INDENT * (depth + 1)
        self._declare(name)
        match source:
            case ast.Call(func=ast.Name(id="range"), args=[last]):
                head = f"{pad}for ({name} = 0; {name} < {self._expression(last)}; {name}++) {{"
                return [head, *self._block(body, depth + 1), f"{pad}}}"]
            case ast.Subscript(value=ast.Name(id=table), slice=row) if (
                table in self._names.row_tables
            ):
                at = f"{name}_at"
                self._declare(at)
                start, end = (
                    f"{table}_START[{self._expression(row)}{more}]" for more in ("", " + 1")
                )
                head = f"{pad}for ({at} = {start}; {at} < {end}; {at}++) {{"
                fetch = f"{inner}{name} = {table}[{at}];"
                return [head, fetch, *self._block(body, depth + 1), f"{pad}}}"]
        raise self._error(source, "a loop over something that is neither range() nor a table row")

    def _target(self, node: ast.expr) -> str:
        if isinstance(node, ast.Name):
            self._declare(node.id)
            return node.id
        return self._expression(node)

    def _declare(self, name: str) -> None:
        if name not in self._locals:
            self._locals.append(name)

    def _expression(self, node: ast.expr) -> str:
        match node:
            case ast.Constant(value=bool(value)):
                return str(int(value))
            case ast.Constant(value=int(value)):
                return str(value) if abs(value) < 1 << 31 else f"INT64_C({value})"
            case ast.Name(id=name):
                return f"SMAD_SV_{name.upper()}" if name in self._names.constants else name
            case ast.Attribute(value=ast.Name(id=owner), attr=member):
                if owner in self._names.enums:
                    return enum_name(owner, member)
                return f"{owner}->{member}"
            case ast.Subscript(value=value, slice=index):
                return f"{self._indexed(value)}[{self._expression(index)}]"
            case ast.BinOp(left=left, op=op, right=right):
                return self._binary(left, op, right)
            case ast.UnaryOp(op=ast.Not(), operand=operand):
                return f"!({self._expression(operand)})"
            case ast.UnaryOp(op=ast.USub(), operand=operand):
                return f"-({self._expression(operand)})"
            case ast.BoolOp(op=op, values=values):
                symbol = " && " if isinstance(op, ast.And) else " || "
                return symbol.join(f"({self._expression(value)})" for value in values)
            case ast.Compare():
                return self._comparison(node)
            case ast.Call():
                return self._call(node)
        raise self._error(node, f"{type(node).__name__} has no counterpart")

    def _indexed(self, node: ast.expr) -> str:
        if isinstance(node, ast.Name) and node.id in self._names.tables:
            return node.id
        if isinstance(node, ast.Attribute):
            return self._expression(node)
        raise self._error(node, "an index into something that is neither a field nor a table")

    def _binary(self, left: ast.expr, op: ast.operator, right: ast.expr) -> str:
        one, two = self._expression(left), self._expression(right)
        if isinstance(op, ast.FloorDiv):
            return f"smad_sv_div({one}, {two})"
        if isinstance(op, ast.LShift):
            return f"(INT64_C({one}) << ({two}))"
        if type(op) in _BINARY:
            return f"({one} {_BINARY[type(op)]} {two})"
        raise self._error(left, f"the operator {type(op).__name__} has no counterpart")

    def _comparison(self, node: ast.Compare) -> str:
        terms = [self._expression(term) for term in (node.left, *node.comparators)]
        parts = []
        for n, op in enumerate(node.ops):
            if type(op) not in _COMPARE:
                raise self._error(node, f"the comparison {type(op).__name__} has no counterpart")
            parts.append(f"{terms[n]} {_COMPARE[type(op)]} {terms[n + 1]}")
        return parts[0] if len(parts) == 1 else " && ".join(f"({part})" for part in parts)

    def _call(self, node: ast.Call) -> str:
        arguments = [self._expression(argument) for argument in node.args]
        joined = ", ".join(arguments)
        match node.func:
            case ast.Name(id="int") if len(arguments) == 1:
                return joined
            case ast.Name(id=name) if name in HELPERS:
                return f"{HELPERS[name]}({joined})"
            case ast.Name(id=name) if name in self._names.functions:
                return f"{PREFIX}{name}({joined})"
            case ast.Subscript(value=ast.Name(id=table), slice=index) if (
                table in self._names.function_tables
            ):
                return f"{table}[{self._expression(index)}]({joined})"
        raise self._error(node, "a call of something that is not translated")

    def _error(self, node: ast.AST, what: str) -> TranslationError:
        line = getattr(node, "lineno", 0)
        return TranslationError(
            f"{self._file}, line {line}: {what} in C; write it with integers, fields, tables, if "
            "and for"
        )


def _is_docstring(node: ast.stmt) -> bool:
    return isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant)
