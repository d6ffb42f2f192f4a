"""A configuration as TOML text, and as the lists of the guide."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from smad.config.describe import sections
from smad.config.model import Config


def default_toml() -> str:
    """Every key with its default, purpose and allowed values, as a commented TOML file."""
    lines = [
        "# Configuration of smad. Every key may be left out; the values here are the defaults.",
        "# Units are in the names.",
    ]
    for section in sections():
        lines += ["", f"# {section.purpose}", f"[{section.name}]"]
        for key in section.keys:
            lines.append(f"# {key.description} ({key.allowed})")
            # An inline table could not be added to further down, so an empty one stays a comment.
            lead = "# " if isinstance(key.default, Mapping) else ""
            lines.append(lead + _assignment(key.name, key.default))
    return "\n".join(lines) + "\n"


def config_to_toml(config: Config) -> str:
    """`config` as TOML, for the header of a run log; `parse_config` reads it back unchanged."""
    lines = []
    for section in sections():
        value: Any = config
        for part in section.name.split("."):
            value = getattr(value, part)
        lines.append(f"[{section.name}]")
        lines += [_assignment(key.name, getattr(value, key.name)) for key in section.keys]
    return "\n".join(lines) + "\n"


def markdown_lists() -> str:
    """The reference of the guide: a list for each section."""
    return "\n".join(
        f"### `[{section.name}]`\n\n{section.purpose}\n\n"
        + "".join(
            f"- `{key.name} = {_toml(key.default)}` ({key.allowed}): {key.description}\n"
            for key in section.keys
        )
        for section in sections()
    )


def _assignment(name: str, value: Any) -> str:
    return f"{name} = {_toml(value)}"


def _toml(value: Any) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return _basic_string(value)
    if isinstance(value, Mapping):
        pairs = ", ".join(
            f"{_basic_string(name)} = {_toml(inner)}" for name, inner in value.items()
        )
        return f"{{{pairs}}}"
    if isinstance(value, tuple):
        return "[" + ", ".join(_toml(item) for item in value) + "]"
    return repr(value)


def _basic_string(text: str) -> str:
    escaped = text.replace("\\", "\\\\").replace('"', '\\"')
    return '"' + "".join(_escape(c) for c in escaped) + '"'


def _escape(character: str) -> str:
    code = ord(character)
    return f"\\u{code:04x}" if code < 0x20 or code == 0x7F else character
