"""A configuration as TOML text."""

import json
from collections.abc import Mapping
from operator import attrgetter
from typing import Any

import msgspec

from smad.config.describe import sections
from smad.config.model import Config


def default_toml() -> str:
    """Every key with its default, purpose and allowed values, as a commented TOML file."""
    lines = [
        "# Configuration of smad. Every key may be left out; the values here are the defaults.",
        "# Units are in the names.",
    ]
    for section in sections():
        lead = "# " if section.many else ""
        lines += ["", f"# {section.purpose}", lead + section.heading]
        for key in section.keys:
            lines.append(f"# {key.description} ({key.allowed})")
            if key.default in (None, msgspec.NODEFAULT):
                lines.append(f"# {key.name} =")
            else:
                # An inline table could not be added to further down: an empty one is a comment.
                lead_of_key = "# " if isinstance(key.default, Mapping) else lead
                lines.append(lead_of_key + _assignment(key.name, key.default))
    return "\n".join(lines) + "\n"


def config_to_toml(config: Config) -> str:
    """`config` as TOML, for the header of a run log; `parse_config` reads it back unchanged."""
    lines = []
    for section in sections():
        value: Any = attrgetter(section.name)(config)
        for part in value if section.many else (value,):
            lines.append(section.heading)
            values = ((key.name, getattr(part, key.name)) for key in section.keys)
            lines += [_assignment(name, value) for name, value in values if value is not None]
    return "\n".join(lines) + "\n"


def _assignment(name: str, value: Any) -> str:
    return f"{name} = {_toml(value)}"


def _toml(value: Any) -> str:
    if isinstance(value, Mapping):
        pairs = ", ".join(f"{_toml(name)} = {_toml(inner)}" for name, inner in value.items())
        return f"{{{pairs}}}"
    # What JSON writes TOML reads, but for this one character.
    return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
