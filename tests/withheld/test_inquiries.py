"""Investigations of mystery benches: what is played, and how their ends are counted."""

from pathlib import Path
from typing import Any

import pytest

from tests.withheld.files import read_run
from tests.withheld.inquiries import mark, table
from tests.withheld.quiz import PlayedMystery, riddle
from tests.withheld.test_playing import _programme


def ended(outcome: str, *names: str, truth: str = "rtd_lag", listed: bool = True) -> dict[str, Any]:
    return {
        "outcome": outcome, "names": list(names), "effects": [truth], "listed": listed,
        "minutes": 10.0,
    }  # fmt: skip


@pytest.mark.parametrize(
    ("case", "said"),
    [
        (ended("cause", "rtd_lag"), "rightly"),
        (ended("cause", "rtd_lag", "force_gain"), "with a wrong name"),
        (ended("cause", "force_gain"), "wrongly"),
        (ended("quiet"), "not noticed"),
        (ended("parameters"), "wrongly"),
        (ended("unknown"), "said to be unknown"),
        (ended("group", "rtd_lag", "force_gain"), "not settled"),
        (ended("unknown", listed=False), "rightly"),
        (ended("cause", "rtd_lag", truth="tube_wall_heat", listed=False), "wrongly"),
    ],
)
def test_an_end_is_right_when_it_says_what_there_is(case: dict[str, Any], said: str) -> None:
    assert mark(case) == said


def test_the_table_counts_ends_of_listed_and_other_effects() -> None:
    cases = [ended("cause", "rtd_lag"), ended("cause", "x"), ended("unknown", listed=False)]
    rows = {line.split("|")[1].strip(): line for line in table(cases).splitlines()[2:]}
    assert set(rows) == {"in the library", "not in it", "all"}
    assert rows["in the library"].split("|")[3].strip().startswith("0.50")
    assert rows["all"].split("|")[2].strip() == "3"


def test_a_mystery_plays_each_run_on_a_day_of_its_own(tmp_path: Path) -> None:
    mystery = PlayedMystery(11, _programme(tmp_path / "p"), tmp_path / "runs")
    first, second = (read_run(mystery.record("run-1", good=True)) for _ in range(2))
    assert first["rtd_ambient_degC"][0] != second["rtd_ambient_degC"][0]
    assert mystery.answer() == riddle(11).answer()
