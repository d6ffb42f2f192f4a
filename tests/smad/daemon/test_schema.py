"""The JSON schema of the commands says what the daemon takes; the examples keep to it."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import msgspec
import pytest
from jsonschema import Draft202012Validator

from smad.api import METHODS
from smad.daemon.command.rpc import request_union
from tools.commands_schema import TARGET, main, schema

MATLAB = Path(__file__).resolve().parents[3] / "examples/matlab/command_bench.m"
_STRINGS = re.compile(r"'([^'\n]*)'")


@pytest.fixture(scope="module")
def validator() -> Draft202012Validator:
    document = json.loads(TARGET.read_text())
    Draft202012Validator.check_schema(document)
    return Draft202012Validator(document)


def takes(request: str) -> bool:
    try:
        msgspec.json.decode(request, type=request_union())
    except msgspec.ValidationError:
        return False
    return True


def requests_of(script: str) -> list[str]:
    """The JSON texts that a MATLAB script sends: its strings, joined where a line goes on."""
    joined = re.sub(r"' \.\.\.\n\s*'", "", script)
    return [text for text in _STRINGS.findall(joined) if text.startswith('{"jsonrpc"')]


def test_the_schema_is_not_stale() -> None:
    assert TARGET.read_bytes() == schema()
    assert main(["--check"]) == 0


def test_it_names_every_method_and_its_reply() -> None:
    document = json.loads(schema())
    assert list(document["discriminator"]["mapping"]) == [method.name for method in METHODS]
    names = {method.name: method.reply.__name__ for method in METHODS}
    assert {
        name: reply["$ref"].removeprefix("#/$defs/")
        for name, reply in document["x-replies"].items()
    } == names
    assert set(names.values()) <= set(document["$defs"])


@pytest.mark.parametrize(
    "request_",
    [
        {"method": "arm"},
        {"jsonrpc": "2.0", "id": "a", "method": "idle", "lease": "secret", "generation": 3},
        {"method": "params.set", "params": {"name": "x", "value": 1}},
        {"method": "params.set", "params": {"name": "x"}},
        {"method": "params.set", "params": {"name": "x", "value": 1e13}},
        {"method": "params.set"},
        {"method": "arm", "params": {"now": True}},
        {"method": "arm", "when": "now"},
        {"method": "fly"},
        {"method": "move", "params": {"trajectories": [{"kind": "hold", "duration_s": -1}]}},
        {"method": "move", "params": {"trajectories": [{"kind": "hold", "duration_s": 1}]}},
        {"jsonrpc": "1.0", "method": "arm"},
    ],
)
def test_it_takes_what_the_daemon_takes(
    validator: Draft202012Validator, request_: dict[str, Any]
) -> None:
    assert validator.is_valid(request_) == takes(json.dumps(request_))


def test_the_example_for_matlab_sends_requests_that_the_daemon_takes(
    validator: Draft202012Validator,
) -> None:
    requests = requests_of(MATLAB.read_text("utf-8"))
    assert [json.loads(text)["method"] for text in requests] == [
        "status", "disarm", "arm", "record.start", "move", "motion", "record.stop",
    ]  # fmt: skip
    for text in requests:
        validator.validate(json.loads(text))
        assert takes(text)
