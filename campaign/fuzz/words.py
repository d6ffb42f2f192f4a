"""Words that a mutation may put in: names from the tables, so that it need not guess them."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping

import msgspec

from campaign.fuzz.targets import Target

_TOML = ("true", "false", "nan", "inf", "-inf", "1e999", "[[", '"""', "\\u0000", "\\n", "{", "}")
_JSON = ("null", "true", "{}", "[]", "1e999", "-0.0", "\\u0000", "\\ud800", "18446744073709551616")


def dictionary(target: Target) -> str:
    """Return the words of a target as a libFuzzer dictionary; empty for targets without."""
    words = _WORDS.get(target.name, _no_words)()
    return "".join(f'"{_escaped(word.encode())}"\n' for word in sorted(set(words)) if word)


def _escaped(word: bytes) -> str:
    return "".join(
        chr(byte) if 32 <= byte < 127 and byte not in b'"\\' else f"\\x{byte:02x}" for byte in word
    )


def _no_words() -> Iterable[str]:
    return ()


def _config() -> Iterable[str]:
    from smad.config import Config, default_toml

    yield from _TOML
    yield from Config.__struct_fields__
    for line in default_toml().splitlines():
        if line and not line.startswith("#"):
            yield line.partition(" =")[0]


def _parameters() -> Iterable[str]:
    from sim_device.plant.parameters import BUILT_IN, NAMES, STATUSES
    from sim_device.plant.units import UNITS

    yield from _TOML
    yield from (*NAMES, *STATUSES, *UNITS, *BUILT_IN.values(), "extends = ")
    yield from ("value", "unit", "status", "range", "source", "title")


def _models() -> Iterable[str]:
    from sim_device.plant.constants import VARIANTS
    from sim_device.plant.effects.registry import EFFECTS
    from sim_device.plant.models import FORMAT
    from sim_device.plant.parameters import BUILT_IN, NAMES

    yield from (*_TOML, *_JSON, *NAMES, *BUILT_IN, *VARIANTS, FORMAT)
    yield from ("format", "base", "variant", "overrides", "effects", "note", "self", "[overrides]")
    for entry in EFFECTS:
        yield entry.name
        yield f"[effects.{entry.name}]"
        yield from (parameter.name for parameter in entry.parameters)


def _commands() -> Iterable[str]:
    from smad.api import METHODS

    yield from (*_JSON, '"method":', '"params":', '"id":', '"jsonrpc":"2.0"')
    for method in METHODS:
        yield f'"{method.name}"'
        yield from (f'"{field.name}":' for field in msgspec.structs.fields(method.params))


def _import() -> Iterable[str]:
    from sim_device.plant.units import UNITS
    from smad.records.column_names import ALIASES
    from smad.runlog.schema import CHANNELS

    yield from (*CHANNELS, *ALIASES, *UNITS, *_JSON, *_TOML)
    yield from ("\f", "\f\f", "\ufeff", "#", "NaN", '"', ";", "\t", "\r\n", "[columns.", "decimal")


def _description() -> Iterable[str]:
    from firmware_protocol.codec import CODEC
    from firmware_protocol.schema import wire_name
    from firmware_protocol.wire import BLOCK_KINDS, NUMBER_CODES, RECORD_KIND, fields_of

    yield from (*_JSON, *BLOCK_KINDS, *NUMBER_CODES, RECORD_KIND)
    yield from ('"messages":', '"enums":', '"parameters":', '"version":', '"name":', '"number":')
    yield from ('"fields":', '"kind":', '"count":', '"record":')
    for cls in CODEC.messages:
        yield f'"{wire_name(cls)}"'
        yield f'"number":{cls.info.number}'
        yield from (f'"{field.name}"' for field in fields_of(cls))


def _runlog() -> Iterable[str]:
    from smad.runlog.header import METADATA_NAME, RunHeader
    from smad.runlog.schema import CHANNELS, TOPICS
    from smad.runlog.writer import END_METADATA_NAME

    yield from (*CHANNELS, *TOPICS.values(), *RunHeader.__struct_fields__, *_JSON)
    yield from (METADATA_NAME, END_METADATA_NAME, "dropped", "zstd", "lz4", '"t_s":', '"kind":')


_WORDS: Mapping[str, Callable[[], Iterable[str]]] = {
    "config": _config,
    "parameters": _parameters,
    "models": _models,
    "commands": _commands,
    "description": _description,
    "import": _import,
    "runlog": _runlog,
}
