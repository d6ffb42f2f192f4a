"""Write the blocking client: the one for asyncio without its `async` and `await`.

`python -m tools.blocking_client` writes `smad/client/blocking.py`; with `--check` it only says
whether that is stale, and ends with status 1 if so.
"""

from __future__ import annotations

import re
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

FOLDER = Path(__file__).resolve().parents[1] / "smad" / "client"
SOURCE = FOLDER / "asynchronous.py"
TARGET = FOLDER / "blocking.py"
_DOCSTRING = (
    '"""The blocking client: one method for each command of `smad.api`; every wait has a deadline.'
    "\n\nWritten by `python -m tools.blocking_client` from asynchronous.py: edit that.\n"
    '"""'
)
_REPLACED = (
    (r'\A""".*?"""', _DOCSTRING),
    (r"\b(async|await) ", ""),
    (r"\basync_channel\b", "channel"),
    (r"\basynccontextmanager\b", "contextmanager"),
    (r"\bAsync(Client|Channel|Iterator|Generator)\b", r"\1"),
    (r"\b__a(enter|exit)__\b", r"__\1__"),
)


def blocking() -> str:
    """Return the text of the blocking client."""
    text = SOURCE.read_text()
    for pattern, replacement in _REPLACED:
        text = re.sub(pattern, replacement, text, flags=re.DOTALL)
    for arguments in (["check", "--select", "I", "--fix-only"], ["format"]):
        text = subprocess.run(
            [sys.executable, "-m", "ruff", *arguments, "-q", "--stdin-filename", TARGET, "-"],
            input=text,
            stdout=subprocess.PIPE,
            text=True,
            check=True,
        ).stdout
    return text


def main(arguments: Sequence[str]) -> int:
    """Write the client anew, or say that it is stale."""
    text = blocking()
    stale = TARGET.read_text() != text
    if stale and "--check" not in arguments:
        TARGET.write_text(text)
        return 0
    if stale:
        print(f"smad/client/{TARGET.name} is stale; run make generate", file=sys.stderr)
    return 1 if stale else 0


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
