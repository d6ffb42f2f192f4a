"""Every command that can arm is in the table of programs, found in the source itself."""

from __future__ import annotations

import ast
import functools
from collections.abc import Iterator
from pathlib import Path

import click

import smad
from smad.cli import root
from smad.cli.repeat import repeat
from tests.smad.programs.__main__ import PHASES, lines
from tests.smad.programs.table import CASES, PROGRAMS

SOURCE = Path(smad.__file__).parent
PLACES = ("smad.cli.", "smad.client.arming.", "smad.demo.", "smad.experiments.", "smad.checkup.")
ARMS = {"arm", "armed"}


@functools.cache
def _module(name: str) -> tuple[dict[str, ast.AST], dict[str, tuple[str, str]]]:
    """The functions and classes of a module by name, and where the names it imports are from."""
    path = SOURCE.parent / (name.replace(".", "/") + ".py")
    if not f"{name}.".startswith(PLACES) or not path.exists():
        return {}, {}
    tree = ast.parse(path.read_text())
    defined: dict[str, ast.AST] = {
        node.name: node
        for node in tree.body
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef)
    }
    imported: dict[str, tuple[str, str]] = {}
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and node.module:
            for alias in node.names:
                imported[alias.asname or alias.name] = (node.module, alias.name)
    return defined, imported


def _calls_arm(node: ast.AST) -> bool:
    return any(
        isinstance(n, ast.Call) and isinstance(n.func, ast.Attribute) and n.func.attr in ARMS
        for n in ast.walk(node)
    )


def can_arm(module: str, function: str) -> bool:
    """Whether a function or class arms, itself or by way of what it uses."""
    seen, waiting = set[tuple[str, str]](), [(module, function)]
    while waiting:
        here = waiting.pop()
        if here in seen:
            continue
        seen.add(here)
        defined, imported = _module(here[0])
        node = defined.get(here[1])
        if node is None:
            continue
        if _calls_arm(node):
            return True
        used = {n.id for n in ast.walk(node) if isinstance(n, ast.Name)}
        waiting += [imported.get(name, (here[0], name)) for name in used]
        for n in ast.walk(node):
            # `from smad.demo import job`, and then `job.run_cycle`.
            if isinstance(n, ast.Attribute) and isinstance(n.value, ast.Name):
                package, part = imported.get(n.value.id, ("", ""))
                waiting.append((f"{package}.{part}", n.attr))
    return False


def commands(
    command: click.Command = root, words: tuple[str, ...] = ("smad",)
) -> Iterator[tuple[str, click.Command]]:
    """Every command by its words."""
    if command.callback is not None:
        yield " ".join(words), command
    if isinstance(command, click.Group):
        context = click.Context(command)
        for name in command.list_commands(context):
            below = command.get_command(context, name)
            assert below is not None
            yield from commands(below, (*words, name))
    if words == ("smad", "run"):
        # It is no command of a group: `smad run` takes its word for it.
        yield from commands(repeat, (*words, "repeat"))


def _arming() -> set[str]:
    return {
        words
        for words, command in commands()
        if command.callback and can_arm(command.callback.__module__, command.callback.__name__)
    }


def test_every_command_that_can_arm_is_in_the_table() -> None:
    arming = _arming()
    rows = [part.split(" --")[0] for row in PROGRAMS for part in row.split(", ")]
    assert arming >= {"smad arm", "smad tune", "smad gap commission", "smad run repeat"}
    missing = {words for words in arming if not any(row.startswith(words) for row in rows)}
    assert not missing


def test_the_table_that_is_printed_holds_every_phase_and_program() -> None:
    assert {phase for _, phase, _ in CASES} <= set(PHASES)
    assert len(lines()) == len(PROGRAMS) + 4
