"""Expressions of the supervisor's core as C of the narrowest types that their ranges allow.

An `Expression` carries its C text, the type that the text has, and the range of its values, worked
out from the ranges of what it is made of. Operands are brought to a type that holds both of them
and the result before C can do anything of its own with them; so it does not matter how wide an
int is, and nothing overflows.
"""

from __future__ import annotations

import ast
from itertools import product
from typing import NamedTuple

from firmware_protocol.supervisor.ranges import FLAG, Range, counted_as

PREFIX = "smad_sv_"


class Expression(NamedTuple):
    """C text, the C type it has, and the range of its values."""

    text: str
    kind: str
    span: Range

    def as_kind(self, kind: str) -> str:
        """Return the text with a cast if the type differs."""
        return self.text if self.kind == kind else f"({kind}){self.text}"

    @property
    def bits(self) -> str:
        """Return the size of the type it is calculated in, as the helpers' names end."""
        return "".join(ch for ch in counted_as(self.span) if ch.isdigit())


def constant(value: int, name: str = "") -> Expression:
    """Return a constant, by its name if it has one."""
    kind = counted_as(Range(value, value))
    literal = f"({value})" if value < 0 else str(value)
    # A constant that fits 16 bits has the type int, whatever its width.
    return Expression(name or literal, kind, Range(value, value))


def truth(text: str) -> Expression:
    """Return a condition."""
    return Expression(text, "int16_t", FLAG)


_SYMBOL: dict[type[ast.operator], str] = {
    ast.Add: "+", ast.Sub: "-", ast.Mult: "*", ast.BitAnd: "&", ast.BitOr: "|",
    ast.LShift: "<<", ast.RShift: ">>",
}  # fmt: skip
OPERATORS = (*_SYMBOL, ast.FloorDiv)


def binary(left: Expression, op: ast.operator, right: Expression) -> Expression:
    """Return `left op right`."""
    span = _span(left.span, op, right.span)
    kind = counted_as(left.span, right.span, span)
    first, second = left.as_kind(kind), right.as_kind(kind)
    power = right.span.low.bit_length() - 1
    if isinstance(op, ast.FloorDiv) and right.span == (1 << power, 1 << power):
        return Expression(f"({first} >> {power})", kind, span)
    if isinstance(op, ast.LShift):
        # As a product: shifting a negative number to the left is undefined.
        return Expression(f"({first} * (({kind})1 << {right.text}))", kind, span)
    if isinstance(op, ast.FloorDiv):
        bits = kind.removeprefix("int").removesuffix("_t")
        return Expression(f"{PREFIX}div{bits}({first}, {second})", kind, span)
    return Expression(f"({first} {_SYMBOL[type(op)]} {second})", kind, span)


def _span(left: Range, op: ast.operator, right: Range) -> Range:
    match op:
        case ast.Add():
            return Range(left.low + right.low, left.high + right.high)
        case ast.Sub():
            return Range(left.low - right.high, left.high - right.low)
        case ast.Mult():
            ends = [a * b for a, b in product(left, right)]
        case ast.FloorDiv():
            if right.low < 1:
                raise ValueError(f"the divisor can be {right.low}; make it at least 1")
            ends = [a // b for a, b in product(left, right)]
        case ast.RShift():
            ends = [a >> b for a, b in product(left, right)]
        case ast.LShift():
            ends = [a << b for a, b in product(left, right)]
        case _:
            if left.low < 0 or right.low < 0:
                raise ValueError("bits of a number that can be negative")
            if isinstance(op, ast.BitAnd):
                return Range(0, min(left.high, right.high))
            return Range(0, (1 << max(left.high, right.high).bit_length()) - 1)
    return Range(min(ends), max(ends))


def compared(left: Expression, symbol: str, right: Expression) -> Expression:
    """Return a comparison in a type that holds both sides."""
    kind = counted_as(left.span, right.span)
    return truth(f"{left.as_kind(kind)} {symbol} {right.as_kind(kind)}")


def extreme(name: str, arguments: list[Expression]) -> Expression:
    """Return `min` or `max` of two."""
    first, second = arguments
    pick = min if name == "min" else max
    span = Range(pick(first.span.low, second.span.low), pick(first.span.high, second.span.high))
    kind = counted_as(first.span, second.span)
    bits = kind.removeprefix("int").removesuffix("_t")
    text = f"{PREFIX}{name}{bits}({first.as_kind(kind)}, {second.as_kind(kind)})"
    return Expression(text, kind, span)


def absolute(value: Expression) -> Expression:
    """Return the absolute value."""
    low, high = value.span
    least = 0 if low <= 0 <= high else min(abs(low), abs(high))
    span = Range(least, max(abs(low), abs(high)))
    kind = counted_as(value.span, span)
    bits = kind.removeprefix("int").removesuffix("_t")
    return Expression(f"{PREFIX}abs{bits}({value.as_kind(kind)})", kind, span)


def negative(value: Expression) -> Expression:
    """Return the negative value."""
    span = Range(-value.span.high, -value.span.low)
    kind = counted_as(value.span, span)
    return Expression(f"-({value.as_kind(kind)})", kind, span)


def followed(arguments: list[Expression]) -> Expression:
    """Return a step towards a target (see memory.follow): it never leaves the span of both."""
    value, target, share = arguments
    span = value.span.joined(target.span)
    if counted_as(span) == "int64_t" or not Range(0, 65_535).holds(share.span):
        raise ValueError("a step towards a target is made in 32 bits, by a share of 16")
    text = f"{value.as_kind('int32_t')}, {target.as_kind('int32_t')}, {share.text}"
    return Expression(f"{PREFIX}follow({text})", "int32_t", span)


def within_range(value: Expression, within: Range) -> Expression:
    """Return the value, held at the ends of a range."""
    kind = counted_as(value.span, within)
    bits = kind.removeprefix("int").removesuffix("_t")
    low, high = constant(within.low), constant(within.high)
    text = f"{PREFIX}hold{bits}({value.as_kind(kind)}, {_literal(low)}, {_literal(high)})"
    return Expression(text, kind, within)


def _literal(value: Expression) -> str:
    # -2147483648 is a minus before a number that no long holds.
    if value.span.low == -(1 << 31):
        return "-2147483647 - 1"
    return value.text.strip("()")
