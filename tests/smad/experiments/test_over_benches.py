"""The table over many benches is made from the shipped file."""

import math

from smad.experiments.over_benches import GAINS, QUANTITIES, Group, groups, table


def group(r2: tuple[float, ...], settling_s: tuple[float, ...]) -> Group:
    empty = {key: (0.0,) * len(r2) for key in QUANTITIES}
    values = {"shipped": empty | {"r2": r2, "settling_s": settling_s}}
    return Group("drawn", 100, 3.0, len(r2), 0, values)


def test_median_bad_end_and_worst_stand_in_this_order() -> None:
    line = table([group((0.1, 0.5, 0.9), (1.0, 2.0, 3.0))]).splitlines()[-1]
    assert line.startswith(
        "| drawn, 3 simulated benches, 100 Hz, noise ×3 | shipped | 0.500, 0.100, "
    )
    assert "| 2.00, 3.00, 3.00 |" in line


def test_a_single_bench_has_one_value_each() -> None:
    text = table([group((0.9,), (2.0,)), group((0.1, 0.5, 0.9), (1.0, 2.0, 3.0))])
    assert "| drawn, 100 Hz, noise ×3 | shipped | 0.900 | 2.00 | 0.00 |" in text


def test_who_never_settles_is_the_worst() -> None:
    text = table([group((0.1, 0.5, 0.9), (math.nan, 1.0, 2.0))])
    assert "| 2.00, never, never |" in text


def test_the_shipped_file_has_every_quantity_of_every_bench() -> None:
    found = groups()
    assert any("tuned" in one.values and one.benches > 1 for one in found)
    for one in found:
        assert set(one.values) <= set(GAINS)
        for values in one.values.values():
            assert set(values) == set(QUANTITIES)
            assert len(values["r2"]) == one.benches


def test_no_shipped_bench_starts_a_pump_more_than_twice_in_a_hold() -> None:
    for one in groups():
        for values in one.values.values():
            assert max(values["starts"], default=0.0) <= 2.0
