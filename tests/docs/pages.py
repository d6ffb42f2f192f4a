"""Find the commands that a documentation page shows, and run them as a reader would.

A page is Markdown. A fenced block marked `console` holds commands behind `$ `, each followed by
what it printed; one marked `python` holds a script. Comments on the line before a fence say how it
is run:

    <!-- bench: sim -->             the page's commands need a running simulated bench (once a page)
                                    with what follows `sim` as more options of `smad start`
    <!-- exits: 2 -->               the commands of the next block end with this status
    <!-- not run: why -->           the next block is not run; the reason is listed by the test
"""

import re
from dataclasses import dataclass, field
from pathlib import Path

FENCE = re.compile(r"^```(\w+)?\s*$")
DIRECTIVE = re.compile(r"^<!--\s*(bench|exits|not run):\s*(.+?)\s*-->$")


@dataclass(frozen=True)
class Block:
    """One fenced block: its language, text, first line, and the directives before it."""

    language: str
    text: str
    line: int
    exits: int = 0
    not_run: str | None = None

    def commands(self) -> list[str]:
        """The shell commands of a console block; a trailing backslash joins the next line."""
        commands: list[str] = []
        pending = ""
        for raw in self.text.splitlines():
            if pending:
                line = raw.strip()
            elif raw.startswith("$ "):
                line = raw[2:].strip()
            else:
                continue
            pending = f"{pending} {line}".strip()
            if pending.endswith("\\"):
                pending = pending[:-1].strip()
                continue
            commands.append(pending)
            pending = ""
        return commands


@dataclass
class Page:
    """A documentation page and its blocks, in reading order."""

    path: Path
    bench: tuple[str, ...] | None = None
    """More options of the simulated bench that its commands need; None: they need none."""
    blocks: list[Block] = field(default_factory=list)


def read_page(path: Path) -> Page:
    """Read the fenced `console` and `python` blocks of a page.

    Raises ValueError, naming page and line, for a fence that never closes.
    """
    page = Page(path)
    directives: dict[str, str] = {}
    lines = path.read_text().splitlines()
    at = 0
    while at < len(lines):
        if found := DIRECTIVE.match(lines[at].strip()):
            directives[found[1]] = found[2]
            if found[1] == "bench":
                page.bench = tuple(found[2].split()[1:])
        elif opened := FENCE.match(lines[at]):
            start = at + 1
            at = start
            while at < len(lines) and not lines[at].startswith("```"):
                at += 1
            if at == len(lines):
                raise ValueError(f"{path}:{start}: this fence never closes")
            if opened[1] in ("console", "python"):
                page.blocks.append(
                    Block(
                        language=opened[1],
                        text="\n".join(lines[start:at]),
                        line=start,
                        exits=int(directives.get("exits", "0")),
                        not_run=directives.get("not run"),
                    )
                )
            directives = {}
        elif lines[at].strip():
            directives = {}
        at += 1
    return page
