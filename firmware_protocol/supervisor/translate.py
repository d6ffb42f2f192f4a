"""From the supervisor's Python to portable C99, function by function.

Only the Python that the supervisor's core uses is known: integers, fields of four records, fixed
tables, if, for over a range or a table row, and calls of each other. Whatever else turns up raises
TranslationError with file and line, so that the core cannot grow out of what C can do.

Each number has the narrowest type that its range allows (see ranges and typed). `//` rounds down
in both languages; `%` is not used.
"""

from __future__ import annotations

import ast
import inspect
import re
from collections.abc import Mapping
from dataclasses import dataclass
from enum import IntEnum
from types import ModuleType

from firmware_protocol.supervisor import ranges, typed
from firmware_protocol.supervisor.errors import TranslationError
from firmware_protocol.supervisor.limits import LIMIT_ROWS
from firmware_protocol.supervisor.ranges import ARGUMENTS, RECORDS, RESULT, RESULTS, Range
from firmware_protocol.supervisor.typed import Expression, constant, truth

PREFIX = "smad_sv_"
POINTERS = {
    "Memory": "struct smad_sv_memory *",
    "Measurements": "const struct smad_sv_measurements *",
    "Limits": "const struct smad_sv_limits *",
    "Command": "const struct smad_sv_command *",
}
_COMPARE: dict[type[ast.cmpop], str] = {
    ast.Eq: "==", ast.NotEq: "!=", ast.Lt: "<", ast.LtE: "<=", ast.Gt: ">", ast.GtE: ">=",
}  # fmt: skip
INDENT = "    "


@dataclass(frozen=True)
class Names:
    """What the functions may mention besides their arguments."""

    functions: Mapping[str, tuple[str, ...]]
    """Names of the arguments of each function."""
    enums: Mapping[str, type[IntEnum]]
    constants: Mapping[str, int]
    tables: Mapping[str, Range]
    """Ranges of one-dimensional tables, written `TABLE[index]`."""
    row_tables: Mapping[str, Range]
    """Ranges of tables of rows, written `for item in TABLE[row]`."""
    function_tables: Mapping[str, tuple[str, ...]]
    """Names of the arguments that the functions of a table take."""


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
        self._spans: dict[str, Range] = {}
        """Range of each local at this place of the function."""
        self._widest: dict[str, Range] = {}
        """Range of each local in the whole function, which its type has to hold."""
        self._arguments: dict[str, str] = {}
        self._function = ""
        self._result = RESULT
        self.saturated: set[str] = set()
        """Fields and arguments that are held at the ends of their range somewhere."""

    def prototype(self, function: ast.FunctionDef, *, public: bool) -> str:
        """Return the C declaration, without a semicolon."""
        arguments = []
        for argument in function.args.args:
            kind = argument.annotation
            name = argument.arg
            if isinstance(kind, ast.Name) and kind.id in POINTERS:
                arguments.append(POINTERS[kind.id] + name)
            elif isinstance(kind, ast.Name) and kind.id == "int" and name in ARGUMENTS:
                arguments.append(f"{ranges.stored_as(ARGUMENTS[name])} {name}")
            else:
                raise self._error(argument, "an argument of unknown type")
        returns = function.returns
        nothing = isinstance(returns, ast.Constant) and returns.value is None
        result = "void" if nothing else ranges.stored_as(_result_of(function.name))
        storage = "" if public else "static "
        return f"{storage}{result} {PREFIX}{function.name}({', '.join(arguments)})"

    def definition(self, function: ast.FunctionDef, *, public: bool) -> str:
        """Return the whole C function."""
        arguments = {argument.arg: argument.annotation for argument in function.args.args}
        self._arguments = {
            name: kind.id for name, kind in arguments.items() if isinstance(kind, ast.Name)
        }
        body = [node for node in function.body if not _is_docstring(node)]
        self._widest = {}
        self._function, self._result = function.name, _result_of(function.name)
        # Once to learn how far each local goes, and once to write it down.
        for _ in range(2):
            self._spans = {}
            lines = self._block(body, 1)
        # Looked for in the C: a limit that is a constant is no use of `lim`.
        used = set(re.findall(r"\w+", "\n".join(lines)))
        head = [f"{INDENT}{self._kind_of(name)} {name};" for name in self._widest]
        head += [f"{INDENT}(void){name};" for name in arguments if name not in used]
        text = "\n".join([*head, *lines])
        return f"{self.prototype(function, public=public)}\n{{\n{text}\n}}\n"

    def _kind_of(self, name: str) -> str:
        return ranges.counted_as(self._widest[name])

    # Statements

    def _block(self, nodes: list[ast.stmt], depth: int) -> list[str]:
        return [line for node in nodes for line in self._statement(node, depth)]

    def _statement(self, node: ast.stmt, depth: int) -> list[str]:
        pad = INDENT * depth
        match node:
            case ast.Assign(targets=[target], value=value):
                return [pad + self._assign(target, self._expression(value))]
            case ast.AugAssign(target=target, op=op, value=value):
                changed = self._binary(node, self._expression(target), op, value)
                return [pad + self._assign(target, changed)]
            case ast.Return(value=None):
                return [f"{pad}return;"]
            case ast.Return(value=value) if value is not None:
                result = self._expression(value)
                if self._function in RESULTS:
                    result = self._fitted(result, self._result, self._function)
                elif not self._result.holds(result.span):
                    raise self._error(node, f"a result of {result.span} has no counterpart")
                return [f"{pad}return {result.text};"]
            case ast.Expr(value=ast.Call() as call):
                return [f"{pad}{self._expression(call).text};"]
            case ast.If():
                return self._if(node, depth)
            case ast.For(target=ast.Name(id=name), iter=source, body=body, orelse=[]):
                return self._for(name, source, body, depth)
        raise self._error(node, f"{type(node).__name__} has no counterpart")

    def _assign(self, target: ast.expr, value: Expression) -> str:
        if isinstance(target, ast.Name):
            self._note(target.id, value.span)
            return f"{target.id} = {value.text};"
        field = self._expression(target)
        owner = target.value if isinstance(target, ast.Subscript) else target
        name = owner.attr if isinstance(owner, ast.Attribute) else ""
        return f"{field.text} = {self._fitted(value, field.span, name).text};"

    def _fitted(self, value: Expression, within: Range, name: str) -> Expression:
        """Return a value that fits a range, held at its ends where that is not proved."""
        if within.holds(value.span):
            return value
        self.saturated.add(name)
        return typed.within_range(value, within)

    def _note(self, name: str, span: Range) -> None:
        self._spans[name] = span
        widest = self._widest.get(name)
        self._widest[name] = span if widest is None else widest.joined(span)

    def _if(self, node: ast.If, depth: int) -> list[str]:
        pad = INDENT * depth
        lines = [f"{pad}if ({self._expression(node.test).text}) {{"]
        before = dict(self._spans)
        lines += self._block(node.body, depth + 1)
        after, self._spans = self._spans, before
        rest = node.orelse
        if len(rest) == 1 and isinstance(rest[0], ast.If):
            following = self._if(rest[0], depth)
            lines += [f"{pad}}} else {following[0].strip()}", *following[1:]]
        else:
            if rest:
                lines += [f"{pad}}} else {{", *self._block(rest, depth + 1)]
            lines.append(f"{pad}}}")
        self._join(after)
        return lines

    def _join(self, other: dict[str, Range]) -> None:
        for name, span in other.items():
            before = self._spans.get(name)
            self._spans[name] = span if before is None else before.joined(span)

    def _for(self, name: str, source: ast.expr, body: list[ast.stmt], depth: int) -> list[str]:
        pad, inner = INDENT * depth, INDENT * (depth + 1)
        match source:
            case ast.Call(func=ast.Name(id="range"), args=[last]):
                end = self._expression(last)
                self._note(name, Range(0, end.span.high))
                kind = self._kind_of(name)
                head = f"{pad}for ({name} = 0; {name} < {end.as_kind(kind)}; {name}++) {{"
                return [head, *self._loop(body, depth + 1), f"{pad}}}"]
            case ast.Subscript(value=ast.Name(id=table), slice=row) if (
                table in self._names.row_tables
            ):
                position = f"{name}_at"
                self._note(name, self._names.row_tables[table])
                self._note(position, Range(0, 32_767))
                index = self._expression(row).text
                start, end_text = (f"{table}_START[{index}{more}]" for more in ("", " + 1"))
                head = f"{pad}for ({position} = {start}; {position} < {end_text}; {position}++) {{"
                fetch = f"{inner}{name} = {table}[{position}];"
                return [head, fetch, *self._loop(body, depth + 1), f"{pad}}}"]
        raise self._error(source, "a loop over something that is neither range() nor a table row")

    def _loop(self, body: list[ast.stmt], depth: int) -> list[str]:
        """Return the body of a loop, whose locals may have been set by an earlier turn."""
        before = dict(self._spans)
        self._block(body, depth)
        self._join(before)
        settled = dict(self._spans)
        lines = self._block(body, depth)
        self._join(before)
        if self._spans != settled:
            raise self._error(body[0], "a local that grows from turn to turn has no range")
        return lines

    # Expressions

    def _expression(self, node: ast.expr) -> Expression:
        match node:
            case ast.Constant(value=int(value)):
                return constant(int(value))
            case ast.Name(id=name):
                return self._name(node, name)
            case ast.Attribute(value=ast.Name(id=owner), attr=member):
                return self._attribute(node, owner, member)
            case ast.Subscript(value=value, slice=index):
                row = self._indexed(value)
                return row._replace(text=f"{row.text}[{self._expression(index).text}]")
            case ast.BinOp(left=left, op=op, right=right):
                return self._binary(node, self._expression(left), op, right)
            case ast.UnaryOp(op=ast.Not(), operand=operand):
                return truth(f"!({self._expression(operand).text})")
            case ast.UnaryOp(op=ast.USub(), operand=ast.Constant(value=int(value))):
                return constant(-value)
            case ast.UnaryOp(op=ast.USub(), operand=operand):
                return typed.negative(self._expression(operand))
            case ast.BoolOp(op=op, values=values):
                symbol = " && " if isinstance(op, ast.And) else " || "
                return truth(symbol.join(f"({self._expression(v).text})" for v in values))
            case ast.Compare():
                return self._comparison(node)
            case ast.Call():
                return self._call(node)
        raise self._error(node, f"{type(node).__name__} has no counterpart")

    def _name(self, node: ast.expr, name: str) -> Expression:
        if name in self._names.constants:
            return constant(self._names.constants[name], f"SMAD_SV_{name.upper()}")
        if name in self._spans:
            return Expression(name, self._kind_of(name), self._spans[name])
        if name in ARGUMENTS:
            return Expression(name, ranges.stored_as(ARGUMENTS[name]), ARGUMENTS[name])
        if name in self._arguments:
            return Expression(name, "int64_t", Range(0, 0))
        raise self._error(node, f"the name {name} has no range")

    def _attribute(self, node: ast.expr, owner: str, member: str) -> Expression:
        if owner in self._names.enums:
            value = int(self._names.enums[owner][member])
            return constant(value, enum_name(owner, member))
        record = self._arguments.get(owner, "")
        span = RECORDS.get(record, {}).get(member)
        if span is None:
            raise self._error(node, f"{record}.{member} has no range")
        if record == "Limits" and not LIMIT_ROWS[member].number:
            return constant(LIMIT_ROWS[member].compiled, f"SMAD_SV_LIMIT_{member.upper()}")
        return Expression(f"{owner}->{member}", ranges.stored_as(span), span)

    def _indexed(self, node: ast.expr) -> Expression:
        if isinstance(node, ast.Name) and node.id in self._names.tables:
            return Expression(node.id, "int8_t", self._names.tables[node.id])
        if isinstance(node, ast.Attribute):
            return self._expression(node)
        raise self._error(node, "an index into something that is neither a field nor a table")

    def _binary(
        self, node: ast.AST, left: Expression, op: ast.operator, right: ast.expr
    ) -> Expression:
        if not isinstance(op, typed.OPERATORS):
            raise self._error(node, f"the operator {type(op).__name__} has no counterpart")
        try:
            return typed.binary(left, op, self._expression(right))
        except ValueError as error:
            raise self._error(node, f"({error}) has no counterpart") from None

    def _comparison(self, node: ast.Compare) -> Expression:
        terms = [self._expression(term) for term in (node.left, *node.comparators)]
        parts = []
        for n, op in enumerate(node.ops):
            if type(op) not in _COMPARE:
                raise self._error(node, f"the comparison {type(op).__name__} has no counterpart")
            parts.append(typed.compared(terms[n], _COMPARE[type(op)], terms[n + 1]))
        if len(parts) == 1:
            return parts[0]
        return truth(" && ".join(f"({part.text})" for part in parts))

    def _call(self, node: ast.Call) -> Expression:
        match node.func:
            case ast.Name(id="int") if len(node.args) == 1:
                return self._expression(node.args[0])
            case ast.Name(id="abs"):
                return typed.absolute(self._expression(node.args[0]))
            case ast.Name(id="min" | "max" as name):
                return typed.extreme(name, [self._expression(a) for a in node.args])
            case ast.Name(id="follow"):
                return typed.followed([self._expression(a) for a in node.args])
            case ast.Name(id=name) if name in self._names.functions:
                passed = self._passed(node, self._names.functions[name])
                result = _result_of(name)
                return Expression(f"{PREFIX}{name}({passed})", ranges.stored_as(result), result)
            case ast.Subscript(value=ast.Name(id=table), slice=index) if (
                table in self._names.function_tables
            ):
                passed = self._passed(node, self._names.function_tables[table])
                entry = self._expression(index).text
                return Expression(f"{table}[{entry}]({passed})", "uint8_t", RESULT)
        raise self._error(node, "a call of something that is not translated")

    def _passed(self, node: ast.Call, names: tuple[str, ...]) -> str:
        """Return the arguments of a call, each fitted to the range that its name has."""
        texts = []
        for name, argument in zip(names, node.args, strict=True):
            value = self._expression(argument)
            if name in ARGUMENTS:
                value = self._fitted(value, ARGUMENTS[name], name)
            texts.append(value.text)
        return ", ".join(texts)

    def _error(self, node: ast.AST, what: str) -> TranslationError:
        line = getattr(node, "lineno", 0)
        return TranslationError(
            f"{self._file}, line {line}: {what} in C; write it with integers, fields, tables, if "
            "and for"
        )


def _result_of(function: str) -> Range:
    return RESULTS.get(function, RESULT)


def _is_docstring(node: ast.stmt) -> bool:
    return isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant)
