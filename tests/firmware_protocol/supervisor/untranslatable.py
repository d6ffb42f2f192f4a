"""Functions that no C can be made from, each for another reason."""

import ast
import inspect
import sys

from firmware_protocol.supervisor.memory import Memory


def divides(s: Memory) -> int:
    return int(s.now_us / 2)


def takes_text(s: str) -> int:
    return 1


def loops(s: Memory) -> None:
    while s.now_us:
        s.now_us -= 1


def calls(s: Memory) -> int:
    return len(s.t_cC)


def walks(s: Memory) -> None:
    for t in s.t_cC:
        s.now_us += t


FUNCTIONS = [
    node
    for node in ast.parse(inspect.getsource(sys.modules[__name__])).body
    if isinstance(node, ast.FunctionDef)
]
