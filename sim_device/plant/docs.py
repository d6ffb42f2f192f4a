"""The tables of docs/physics.md, made from the parameter files and the effect registry.

`python -m sim_device.plant.docs` rewrites them in place; a test fails when they are stale.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from itertools import groupby
from pathlib import Path

from sim_device.plant.effects.registry import EFFECTS
from sim_device.plant.parameters import load_parameters
from sim_device.plant.places import BOTH, PLACES, STATES
from sim_device.plant.published import table as published_table

PAGE = Path(__file__).resolve().parents[2] / "docs" / "physics.md"


def parameter_list() -> str:
    """Every entry of set A: symbol, value, status, meaning."""
    return "\n".join(
        f"- `{entry.name}` {entry.symbol} = {entry.shown()} ({entry.status}): {entry.meaning}"
        for entry in load_parameters("A").entries
    )


def differences_table() -> str:
    """What sets B and conserving change of set A."""
    base = load_parameters("A")
    lines = ["| set | entry | set A | here | source |", "|---|---|---|---|---|"]
    for name in ("B", "conserving"):
        other = load_parameters(name)
        lines += [
            f"| {name} | `{entry.name}` | {was.shown()} | {entry.shown()} | {entry.source} |"
            for was, entry in zip(base.entries, other.entries, strict=True)
            if was.value != entry.value
        ]
    return "\n".join(lines)


def effects_list() -> str:
    """Every entry of the effect registry by subsystem."""
    lines: list[str] = []
    for subsystem, group in groupby(EFFECTS, key=lambda entry: entry.subsystem):
        lines += ["", f"{subsystem.capitalize()}:", ""]
        lines += [f"- **`{entry.name}`**: {entry.title}" for entry in group]
    return "\n".join(lines[1:])


def _needs(needs: Sequence[tuple[str, tuple[str, ...]]]) -> str:
    options = ", ".join(f"{option} {' or '.join(choices)}" for option, choices in needs)
    return f"; needs {options}" if options else ""


def places_table() -> str:
    """Every place of the model, and the states that laws may depend on."""
    lines = [
        "| place | what is forced | unit | typical size | sides | touches first |",
        "|---|---|---|---|---|---|",
    ]
    for entry in PLACES:
        channels = ", ".join(f"`{channel}`" for channel in entry.channels_of(BOTH))
        lines.append(
            f"| `{entry.name}` | {entry.label}{_needs(entry.needs)} | {entry.unit} |"
            f" {entry.scale:g} | {', '.join(entry.sides)} | {channels} |"
        )
    return "\n".join(lines)


def states_list() -> str:
    """Every state that a law may depend on."""
    return "  \n".join(
        f"`{s.name}` {s.label}{f', {s.unit}' if s.unit not in ('', '1') else ''}" for s in STATES
    )


TABLES: dict[str, Callable[[], str]] = {
    "parameters": parameter_list,
    "differences": differences_table,
    "effects": effects_list,
    "places": places_table,
    "states": states_list,
    "published": published_table,
}


def rendered(text: str) -> str:
    """The page with every generated table made anew. Raises ValueError for a missing marker."""
    for name, make in TABLES.items():
        start, end = f"<!-- table: {name} -->\n", "<!-- end of table -->"
        if start not in text:
            raise ValueError(f"{PAGE.name} has no marker {start.strip()!r}; put it back")
        head, _, rest = text.partition(start)
        _, _, tail = rest.partition(end)
        text = f"{head}{start}{make()}\n{end}{tail}"
    return text


def main(arguments: list[str]) -> int:
    """Write the page's tables anew; with `--check`, only say whether they are stale (status 1)."""
    text = PAGE.read_text(encoding="utf-8")
    fresh = rendered(text)
    if "--check" in arguments:
        if fresh != text:
            print(f"{PAGE.name} is stale: run make generate", file=sys.stderr)
        return int(fresh != text)
    PAGE.write_text(fresh, encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
