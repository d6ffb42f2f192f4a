"""The benchmark measures what it says; its numbers are looked at, not tested."""

import pytest

from bench import wire


def test_every_row_of_the_benchmark_has_a_name_a_positive_value_and_a_unit(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(wire, "CALLS", 200)
    monkeypatch.setattr(wire, "ROUNDS", 1)
    rows = wire.rows()
    assert len({name for name, _, _ in rows}) == len(rows) == 4
    assert all(value > 0 and unit == "us" for _, value, unit in rows)
