"""The configuration: a file is refused in words, or every value is within its range."""

from __future__ import annotations

import msgspec

from campaign.fuzz.files import file_with
from campaign.fuzz.program import require
from smad.config import Config, config_to_toml, load_config, parse_config
from smad.errors import ConfigError


def run(data: bytes) -> None:
    """The input is the file."""
    path = file_with("config.toml", data)
    try:
        config = load_config(path)
    except ConfigError as error:
        require(str(error).strip(), "a refusal without words")
        return
    # msgspec checks ranges when it converts, so a value out of range raises here.
    checked = msgspec.convert(msgspec.to_builtins(config), Config)
    require(checked == config, "the configuration does not survive a check of its ranges")
    text = config_to_toml(config)
    require(parse_config(text) == config, "written out it reads otherwise:\n{}", text)
