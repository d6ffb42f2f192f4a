"""`python -m firmware_protocol.supervisor.generate [--check]`: the C code and docs/safety.md."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from firmware_protocol.supervisor import c_source, document
from firmware_protocol.supervisor.errors import SupervisorError

PACKAGE = Path(__file__).resolve().parent.parent
DOCUMENT = PACKAGE.parent / "docs" / "safety.md"


def generated() -> dict[Path, str]:
    """Return the text of each generated file by its path.

    Raises DocumentError or TranslationError.
    """
    files = {
        PACKAGE / "c" / "smad_supervisor.h": c_source.header(),
        PACKAGE / "c" / "smad_supervisor.c": c_source.source(),
    }
    if DOCUMENT.exists():
        files[DOCUMENT] = document.fill(DOCUMENT.read_text(encoding="utf-8"))
    return files


def stale() -> list[Path]:
    """Return the files whose text on disk is not what the tables give."""
    return [
        path
        for path, text in generated().items()
        if not path.exists() or path.read_text(encoding="utf-8") != text
    ]


def main() -> int:
    """Write the generated files, or say which are stale (exit status 1)."""
    parser = argparse.ArgumentParser(
        prog="python -m firmware_protocol.supervisor.generate", description=__doc__
    )
    parser.add_argument("--check", action="store_true", help="write nothing; fail if one is stale")
    options = parser.parse_args()
    try:
        if options.check:
            files = stale()
            for path in files:
                print(
                    f"stale: {path}; run python -m firmware_protocol.supervisor.generate",
                    file=sys.stderr,
                )
            return 1 if files else 0
        for path, text in generated().items():
            path.write_text(text, encoding="utf-8")
    except SupervisorError as error:
        print(f"firmware_protocol.supervisor.generate: {error}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
