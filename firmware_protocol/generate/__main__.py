"""`python -m firmware_protocol.generate [--check]`."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from firmware_protocol.errors import ProtocolError
from firmware_protocol.generate.outputs import generated, stale


def main() -> int:
    """Write the generated files, or say which are stale (exit status 1)."""
    parser = argparse.ArgumentParser(
        prog="python -m firmware_protocol.generate",
        description="Write the schema, the C codec, the golden vectors and the document's tables.",
    )
    parser.add_argument("--check", action="store_true", help="write nothing; fail if one is stale")
    options = parser.parse_args()
    try:
        if options.check:
            return _check(stale())
        for path, text in generated().items():
            path.parent.mkdir(exist_ok=True)
            path.write_text(text, encoding="utf-8")
    except ProtocolError as error:
        print(f"firmware_protocol.generate: {error}", file=sys.stderr)
        return 1
    return 0


def _check(files: list[Path]) -> int:
    for path in files:
        print(f"stale: {path}; run python -m firmware_protocol.generate", file=sys.stderr)
    return 1 if files else 0


if __name__ == "__main__":
    raise SystemExit(main())
