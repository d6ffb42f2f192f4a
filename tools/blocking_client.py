"""Write the blocking client: the one for asyncio without its `async` and `await`.

`python -m tools.blocking_client` writes `smad/client/blocking.py` and `commands.py` there; with
`--check` it only says whether one is stale, and ends with status 1 if so.
"""

from __future__ import annotations

import re
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

FOLDER = Path(__file__).resolve().parents[1] / "smad" / "client"
SOURCES = {
    "asynchronous.py": (
        "blocking.py",
        "The blocking client: one method for each command of `smad.api`; "
        "every wait has a deadline.",
    ),
    "async_commands.py": (
        "commands.py",
        "What an axis can be told and asked: the part of the blocking client that has one.",
    ),
}
_DOCSTRING = '"""{}\n\nWritten by `python -m tools.blocking_client` from {}: edit that.\n"""'
_REPLACED = (
    (r"\b(async|await) ", ""),
    (r"\basync_(channel|commands)\b", r"\1"),
    (r"\basynccontextmanager\b", "contextmanager"),
    (r"\bAsync(Client|Channel|Commands|Axis|Iterator|Generator)\b", r"\1"),
    (r"\b__a(enter|exit)__\b", r"__\1__"),
)


def blocking(source: str) -> str:
    """Return the text of what is made from a file of the client for asyncio."""
    target, words = SOURCES[source]
    text = (FOLDER / source).read_text()
    for pattern, replacement in _REPLACED:
        text = re.sub(pattern, replacement, text)
    # Afterwards: the name of the source stays.
    text = re.sub(r'\A""".*?"""', _DOCSTRING.format(words, source), text, count=1, flags=re.DOTALL)
    for arguments in (["check", "--select", "I", "--fix-only"], ["format"]):
        text = subprocess.run(
            [
                sys.executable,
                "-m",
                "ruff",
                *arguments,
                "-q",
                "--stdin-filename",
                FOLDER / target,
                "-",
            ],
            input=text,
            stdout=subprocess.PIPE,
            text=True,
            check=True,
        ).stdout
    return text


def main(arguments: Sequence[str]) -> int:
    """Write the client anew, or say what of it is stale."""
    status = 0
    for source, (name, _) in SOURCES.items():
        target, text = FOLDER / name, blocking(source)
        if target.exists() and target.read_text() == text:
            continue
        if "--check" in arguments:
            print(f"smad/client/{name} is stale; run make generate", file=sys.stderr)
            status = 1
        else:
            target.write_text(text)
    return status


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
