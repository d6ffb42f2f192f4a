"""TOML text to a checked `Config`; every refusal names the key, the value and what is allowed."""

import re
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import NoReturn

import msgspec

from firmware_protocol.nearest import instead
from smad.config.bounds import in_words, value_at
from smad.config.describe import find_section
from smad.config.model import Config
from smad.config.template import config_to_toml
from smad.config.toml_file import MOST_BYTES
from smad.errors import ConfigError, refused_by_system
from smad.files import read_whole

_PATH = re.compile(r"^(?P<cause>.*) - at `\$\.?(?P<path>[^`]*)`$", re.DOTALL)
_UNKNOWN = re.compile(r"^Object contains unknown field `(?P<name>.*)`$", re.DOTALL)
_HELP = "`smad config show` prints every key"


def load_config(path: str | Path, *, again: bool = False) -> Config:
    """The configuration in the TOML file at `path`; keys left out have their defaults.

    Raises ConfigError when the file cannot be read or holds anything that is not allowed; `again`
    also for a pipe, which can be read only once and would be waited for.
    """
    path = Path(path)
    cause, action = f"cannot read configuration {path}", "check the path given to --config"
    if again and path.exists() and not path.is_file():
        raise ConfigError(f"{cause} again: it is not a file", action="restart with a file")
    with refused_by_system(ConfigError, cause, action=action):
        data = read_whole(path, MOST_BYTES)
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise ConfigError(
            f"{path} is not UTF-8 text (byte {error.start})", action="save it as UTF-8"
        ) from None
    return parse_config(text, source=str(path))


def parse_config(text: str, source: str = "configuration") -> Config:
    """The configuration in a TOML text; `source` names it in error messages.

    Raises ConfigError, as `load_config` does.
    """
    try:
        return msgspec.toml.decode(text, type=Config)
    except msgspec.ValidationError as error:
        _refuse(str(error), text, source)
    except msgspec.DecodeError as error:
        raise ConfigError(
            f"{source} is not valid TOML: {error}", action="correct the line"
        ) from None
    except (RecursionError, ValueError) as error:
        # tomllib recurses into nested arrays, and lets Python's own limit on digits through.
        raise ConfigError(
            f"{source} is not a configuration: {error}", action=f"start afresh; {_HELP}"
        ) from None


def replaced(config: Config, section: str, **values: object) -> Config:
    """Return the configuration with keys of one section changed. Raises ConfigError."""
    changed = msgspec.structs.replace(getattr(config, section), **values)
    # Through the text and back, so that what comes from options is checked like a file.
    return parse_config(
        config_to_toml(msgspec.structs.replace(config, **{section: changed})), source="options"
    )


def with_changes(config: Config, **sections: Mapping[str, object]) -> Config:
    """Return the configuration with keys of sections changed, but not to None.

    Raises ConfigError.
    """
    for section, keys in sections.items():
        changed = {key: value for key, value in keys.items() if value is not None}
        config = replaced(config, section, **changed) if changed else config
    return config


def without_realtime(config: Config) -> Config:
    """Return the configuration with no real-time measure asked for."""
    return replaced(config, "realtime", fifo_priority=0, lock_memory=False, freeze_gc=False)


def bench_in(text: str) -> str:
    """The name of the bench in a configuration's text; empty where another version wrote it."""
    try:
        return parse_config(text).daemon.bench if text else ""
    except ConfigError:
        return ""


def _refuse(message: str, text: str, source: str) -> NoReturn:
    match = _PATH.match(message)
    cause, path = (match["cause"], match["path"]) if match else (message, "")
    unknown = _UNKNOWN.match(cause)
    if unknown:
        _refuse_unknown(unknown["name"], path, source)
    # `axes[0].port` is a key of a table; `daemon.tcp.allowed_keys[0]` an entry of a list.
    section_name, _, name = re.sub(r"\[[^.]*\Z", "", path).rpartition(".")
    section = find_section(re.sub(r"\[.*", "", section_name))
    key = next((k for k in section.keys if k.name == name), None) if section else None
    if key is None and cause.startswith("Expected `object`"):
        raise ConfigError(
            f"{source}: {path} is not a table", limit=f"[{path}] with keys below it", action=_HELP
        ) from None
    if key is None:
        # A check of several keys together; its message says what to do.
        place = f"[{path}] " if path else ""
        raise ConfigError(f"{source}: {place}{in_words(cause)}") from None
    value = value_at(tomllib.loads(text), f"{section_name}.{name}")
    raise ConfigError(
        f"{source}: {path} is not allowed",
        # Of a number in quotes they are what is wrong with it.
        value=f'"{value}"' if "got `str`" in cause and "`bool`" not in cause else value,
        limit=key.allowed,
        action=f"correct it ({key.description})",
    ) from None


def _refuse_unknown(name: str, path: str, source: str) -> NoReturn:
    section = find_section(re.sub(r"\[.*", "", path))
    keys = [key.name for key in section.keys] if section else list(Config.__struct_fields__)
    raise ConfigError(
        f"{source}: unknown key {f'{path}.{name}'.lstrip('.')}",
        action=instead(name, keys, _HELP),
    ) from None
