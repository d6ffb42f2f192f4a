"""The order of the tests: the longest first, or one worker would be left with them at the end."""

from __future__ import annotations

import pytest

LONGEST = "tests/withheld/"


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    items.sort(key=lambda item: not item.nodeid.startswith(LONGEST))
