"""The JSON schema of the commands, made from the types that the daemon decodes.

`python -m tools.commands_schema` writes `smad/commands.schema.json`; with `--check` it only
says whether that is stale, and ends with status 1 if so.
"""

import sys
from collections.abc import Sequence
from pathlib import Path

import msgspec

import smad
from smad.api import METHODS
from smad.daemon.command.rpc import request_union

TARGET = Path(smad.__file__).with_name("commands.schema.json")


def schema() -> bytes:
    """Return the schema of a request; `x-replies` has that of the result of each method."""
    replies = [method.reply for method in METHODS]
    (requests, *results), definitions = msgspec.json.schema_components(
        [request_union(), *replies], ref_template="#/$defs/{name}"
    )
    for method in METHODS:
        # The method tells parameters apart, so their own tag may be left out.
        required = definitions[method.params.__name__].get("required", [])
        tag = method.params.__struct_config__.tag_field
        required[:] = [name for name in required if name != tag]
    document = {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "Requests that the smad daemon answers",
        "description": "JSON-RPC 2.0, one object a message; see docs/guide/clients.md.",
        **requests,
        "x-replies": {m.name: result for m, result in zip(METHODS, results, strict=True)},
        "$defs": definitions,
    }
    return msgspec.json.format(msgspec.json.encode(document), indent=1) + b"\n"


def main(arguments: Sequence[str]) -> int:
    """Write the schema anew, or say that it is stale."""
    stale = not TARGET.exists() or TARGET.read_bytes() != schema()
    if stale and "--check" not in arguments:
        TARGET.write_bytes(schema())
        return 0
    if stale:
        print(f"smad/{TARGET.name} is stale; run make generate", file=sys.stderr)
    return 1 if stale else 0


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
