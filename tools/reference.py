"""What is generated in docs: methods, configuration, channels, decisions, thresholds, scores.

The reference is made from the types. `python -m tools.reference` writes what stands between
`<!-- generated: NAME -->` and `<!-- end -->`; with `--check` it only says whether that is stale,
and ends with status 1 if so.
"""

from __future__ import annotations

import inspect
import json
import re
import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path

import msgspec
from msgspec import Struct
from msgspec import inspect as types

from firmware_protocol.supervisor.document import PARTS as SUPERVISOR
from smad import api
from smad.config.describe import sections
from smad.config.fields import bare, info_of, kind_in_words
from smad.control import commands
from smad.daemon.arming import TRANSITIONS
from smad.diagnosis.constants import Constants, shipped
from smad.runlog.schema import CHANNELS, Row

_DOCS = Path(__file__).resolve().parents[1] / "docs"
_DECISIONS = _DOCS / "decisions"
_SCORES = _DOCS.parent / "evaluation" / "results" / "sealed-check-ups.json"
PAGES = (
    _DOCS / "guide/clients.md",
    _DOCS / "guide/configuration.md",
    _DOCS / "guide/run-logs.md",
    _DECISIONS / "README.md",
    _DOCS / "diagnosis.md",
    _DOCS / "safety.md",
    _DOCS.parent / "README.md",
)
_MARKED = re.compile(r"(<!-- generated: (\w+) -->\n).*?(<!-- end -->)", re.DOTALL)
_SUPERSEDED = re.compile(r"^Status: superseded by (\d{4})", re.MULTILINE)
_ACCESS = {
    "watch": "anyone; ",
    "control": "",
    "stop": "anyone, also on the stop channel; ",
}


def methods() -> str:
    """The first sentence of every method, the names of its parameters, and its reply."""
    return "".join(line for method in api.METHODS for line in _method(method))


def pieces() -> str:
    """The pieces of motion that `move` takes."""
    return "".join(line for struct in commands.PIECES for line in _piece(struct))


def telemetry() -> str:
    """The fields of a published sample that a row of the run log does not have."""
    shared = {field.name for field in msgspec.structs.fields(Row)}
    return "".join(line for line in _fields(api.Telemetry) if line.split("`")[1] not in shared)


def channels() -> str:
    """Every channel of the run log: unit, where it comes from, what it is."""
    rows = [
        (c.name, f"{c.unit}, {c.source}" if c.unit else c.source, c.description)
        for c in CHANNELS.values()
    ]
    return "".join(_listed(rows))


def configuration() -> str:
    """Every section of the configuration with its purpose."""
    return "\n".join(f"### `{section.heading}`\n\n{section.purpose}\n" for section in sections())


def reasons() -> str:
    """The reasons for a refusal by the code of the error reply."""
    by_code: dict[int, list[str]] = {}
    for reason in api.Reason:
        by_code.setdefault(api.ERROR_CODES.get(reason, api.REFUSED), []).append(f"`{reason}`")
    return "".join(f"- {code}: {', '.join(names)}\n" for code, names in by_code.items())


def decisions() -> str:
    """Every decision with its title, the first line of its page; a superseded one says by which."""
    rows = []
    for page in sorted(_DECISIONS.glob("[0-9]*.md")):
        text = page.read_text()
        number, title = text.partition("\n")[0].removeprefix("# ").split(" ", 1)
        superseded = _SUPERSEDED.search(text)
        note = f" (superseded by {superseded[1]})" if superseded else ""
        rows.append(f"- [{number}]({page.name}) {title}{note}\n")
    return "".join(rows)


_MORE, _LESS = "▲", "▼"
_TRUST = {
    "quiet benches called changed": (_LESS, "a change reported on an unchanged bench"),
    "parameters given a cause": (_LESS, "a cause reported where only parameters had changed"),
    "noticed near 1 floor": (_MORE, "an effect of about one floor noticed"),
    "noticed near 3 floors": (_MORE, "an effect of about three floors noticed"),
    "place right first, listed": (_MORE, "noticed effects of the library: right place first"),
    "place right first, unlisted": (_MORE, "noticed effects outside it: right place first"),
    "right name reported, of noticed listed": (_MORE, "noticed effects of the library: right name"),
    "right name, of names reported": (_MORE, "names given to noticed effects that were right"),
    "unlisted reported by name": (_LESS, "noticed effects outside the library given a name"),
}
"""Rows of the score table that the README shows: which way is better, and plain words."""


def trust() -> str:
    """A few rows of the last opening's score table."""
    rows = json.loads(_SCORES.read_text())["tables"]["Scores, check-up"]["rows"]
    scores = {name: (value, cases) for name, value, cases, *_ in rows}
    lines = ["| | outcome | share of cases [95 %] | cases |", "|---|---|---:|---:|"]
    lines += [
        f"| {better} | {words} | {' | '.join(scores[name])} |"
        for name, (better, words) in _TRUST.items()
    ]
    return "\n".join((*lines, ""))


def settings() -> str:
    """Every number that decides in a diagnosis, with its value."""
    values = shipped()
    rows = [f"`{name}` = {getattr(values, name):g}" for name in Constants.__struct_fields__]
    return f"{', '.join(rows)}.\n"


def arming() -> str:
    """The diagram of what the daemon knows of an axis, and where each input leads."""
    lines = [
        f"{phase.name}-->|{what.name}|{after.name}"
        for phase, leads in TRANSITIONS.items()
        for what, after in leads.items()
    ]
    return "\n".join(("```mermaid", "flowchart", *lines, "```", ""))


PARTS: dict[str, Callable[[], str]] = {
    "arming": arming,
    "methods": methods,
    "pieces": pieces,
    "telemetry": telemetry,
    "reasons": reasons,
    "configuration": configuration,
    "channels": channels,
    "decisions": decisions,
    "trust": trust,
    "settings": settings,
}


def refreshed(text: str) -> str:
    """Return the page with every generated part made anew, but those of the supervisor."""
    return _MARKED.sub(
        lambda m: m[0] if m[2] in SUPERVISOR else m[1] + PARTS[m[2]]() + m[3],
        text,
    )


def _method(method: api.Method) -> Iterator[str]:
    access = _ACCESS[method.access]
    reply = method.reply.__name__
    takes = ", ".join(f"`{field.name}`" for field in info_of(method.params).fields)
    takes = f" Takes {takes}." if takes else ""
    meaning = f"{_prose(method.params).partition('. ')[0].removesuffix('.')}."
    yield f"- **`{method.name}`** ({access}[{reply}](#replies)): {meaning}{takes}\n"


def _piece(struct: type[Struct]) -> Iterator[str]:
    yield f"- **`{struct.__struct_config__.tag}`** ({struct.__name__}): {_prose(struct)}\n"
    yield from (f"  {line}" for line in _fields(struct))


def _prose(struct: type[Struct]) -> str:
    return " ".join((inspect.getdoc(struct) or "").split())


def _listed(rows: Iterable[tuple[str, str, str]]) -> Iterator[str]:
    """A line for each name, what it is and its meaning; for X and Y one where both are alike."""
    merged: list[tuple[str, str, str]] = []
    for name, kind, meaning in rows:
        x_name, x_kind, x_meaning = merged[-1] if merged else ("", "", "")
        on_y = (_X.sub("_y", x_name), x_kind, x_meaning.replace("X", "Y"))
        if on_y == (name, kind, meaning):
            merged[-1] = (f"{x_name}`, `{name}", kind, x_meaning.replace("X", "X (Y)"))
        else:
            merged.append((name, kind, meaning))
    yield from (f"- `{name}` ({kind}): {meaning}\n" for name, kind, meaning in merged)


_X = re.compile("_x(?=_|$)")


def _fields(struct: type[Struct]) -> Iterator[str]:
    """A line for each field of what is asked: type, default, meaning."""
    return _listed(_described_fields(struct))


def _described_fields(struct: type[Struct]) -> Iterator[tuple[str, str, str]]:
    for field in info_of(struct).fields:
        kind, description = _described(field.type)
        default = "" if field.required else _default(field)
        kind = kind.removesuffix(" or empty") if default == "empty" else kind
        default = {"empty": "optional"}.get(default, default)
        kind = "" if kind == "true or false" and default in ("true", "false") else kind
        facts = "; ".join(part for part in (kind, default) if part)
        yield field.name, facts, description


def _described(kind: types.Type) -> tuple[str, str]:
    _, meta = bare(kind)
    unit = meta.get("unit", "")
    description = meta.get("description", "") + (f" ({unit})" if unit not in ("", "1") else "")
    kind = kind.type if isinstance(kind, types.Metadata) else kind
    if isinstance(kind, types.UnionType) and all(
        isinstance(member, types.StructType) for member in kind.types
    ):
        return "a [piece of motion](#pieces-of-motion)", description
    return kind_in_words(kind), description


def _default(field: types.Field) -> str:
    if field.required:
        return "–"
    value = field.default
    if value is msgspec.NODEFAULT:
        return "none"
    return "empty" if value in (None, "", ()) else str(value).lower()


def main(arguments: Sequence[str]) -> int:
    """Write the pages anew, or say which are stale."""
    texts = {page: page.read_text() for page in PAGES}
    stale = [page for page, text in texts.items() if refreshed(text) != text]
    if "--check" not in arguments:
        for page in stale:
            page.write_text(refreshed(texts[page]))
        return 0
    for page in stale:
        name = page.relative_to(_DOCS.parent)
        print(f"{name} is stale; run python -m tools.reference", file=sys.stderr)
    return 1 if stale else 0


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
