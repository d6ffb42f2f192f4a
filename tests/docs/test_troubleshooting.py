"""The messages that the troubleshooting page explains are those of the code."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PAGE = ROOT / "docs" / "troubleshooting.md"
MESSAGES = [
    row.split("|")[1].strip()
    for row in PAGE.read_text().splitlines()
    if row.startswith("| ") and not row.startswith("| message")
]


def words_of(folder: str) -> str:
    """All the text of a folder's modules, as if no sentence were cut over two lines."""
    texts = (path.read_text() for path in sorted((ROOT / folder).rglob("*.py")))
    return re.sub(r'"\s*\n\s*f?"', "", "\n".join(texts))


CODE = "\n".join(
    [*map(words_of, ("smad", "firmware_protocol")), (ROOT / "tools" / "venv").read_text()]
)


def test_there_are_about_twenty() -> None:
    assert len(MESSAGES) == len(set(MESSAGES))
    assert 20 <= len(MESSAGES) <= 25


@pytest.mark.parametrize("message", MESSAGES)
def test_a_message_that_is_explained_is_one_of_the_code(message: str) -> None:
    pieces = [message] if "its unit is missing" not in message else ["its unit is missing"]
    assert all(piece in CODE for piece in pieces)
