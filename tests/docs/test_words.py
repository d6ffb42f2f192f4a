"""The handbook stays one that is read: so many words of each kind, and no more."""

import pytest

from tools.words import KINDS, counted

MOST = {"decisions": 4_720, "generated reference": 7_500}
MOST_IN_ALL = 40_000
CUT = "cut elsewhere what you add, also in a generated table; python tools/words.py counts"


@pytest.mark.parametrize("kind", MOST)
def test_a_kind_of_page_does_not_grow(kind: str) -> None:
    assert counted()[kind] <= MOST[kind], f"{kind}: {CUT}"


def test_the_handbook_does_not_grow() -> None:
    words = counted()
    assert set(words) == {*KINDS, "generated reference"}
    assert all(words.values())
    assert sum(words.values()) <= MOST_IN_ALL, CUT
