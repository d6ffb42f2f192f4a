"""What the benchmark makes of its measurements."""

from pathlib import Path

from bench.daemon import Plan, Result, percentile, unmasked
from smad.daemon.trace import Trace, load

MS = 1_000_000


def sentinel(late_at: dict[int, int], length_ms: int = 100) -> list[tuple[int, int]]:
    """A sentinel's record: woken each millisecond, late where told."""
    return [(n * MS, late_at.get(n, 20_000)) for n in range(length_ms)]


def test_steps_count_where_no_sentinel_was_late() -> None:
    steps = [(n * MS + 500_000, n) for n in range(90)]
    assert len(unmasked(steps, [sentinel({}), sentinel({})])) == 90
    kept = unmasked(steps, [sentinel({}), sentinel({40: 5 * MS})])
    assert set(range(90)) - set(kept) == set(range(39, 46))


def test_a_long_stall_hides_a_short_one_that_began_later() -> None:
    steps = [(n * MS + 500_000, n) for n in range(90)]
    kept = unmasked(steps, [sentinel({10: 30 * MS, 15: 400_000})])
    assert not any(10 <= n <= 40 for n in kept)


def test_steps_before_and_after_the_sentinels_do_not_count() -> None:
    steps = [(n * MS, n) for n in range(-50, 150)]
    assert set(unmasked(steps, [sentinel({})])) == set(range(100))


def test_without_sentinels_every_step_counts() -> None:
    assert unmasked([(5, 7), (6, 8)], []) == [7, 8]


def test_what_was_left_out_is_reported() -> None:
    result = Result()
    steps = [(n * MS + 500_000, 1000 * n) for n in range(90)]
    result.add(steps, [sentinel({40: 5 * MS})], {"missed samples": 0.0})
    rows = {row.name: row.value for row in result.rows("x")}
    assert rows["x: steps left out"] == 100 * 7 / 90
    assert rows["x: missed samples"] == 0.0


def test_percentiles_are_of_the_sorted_values() -> None:
    assert percentile([3, 1, 2], 0.5) == 2
    assert percentile(range(1000), 0.999) == 999
    assert percentile([], 0.5) == 0.0


def test_a_trace_is_read_back_as_it_was_written(tmp_path: Path) -> None:
    trace = Trace(tmp_path / "trace")
    trace.add(5, 7)
    trace.add(6, 8)
    trace.save()
    assert load(tmp_path / "trace") == [(5, 7), (6, 8)]


def test_the_plan_compares_with_c_at_500_hz_under_load_in_five_runs() -> None:
    plan = Plan()
    assert plan.repeats == 5
    assert {case.who for case in plan.compared} == {"daemon", "C"}
    assert all(case.loaded for case in plan.compared)
    assert plan.seconds == 30


def test_several_runs_give_their_median_and_their_spread() -> None:
    result = Result()
    for slow in (1_000, 9_000, 2_000):
        result.add([(0, slow)], [], {"missed samples": float(slow)})
    row = next(row for row in result.rows("x") if row.name == "x: own p50")
    assert (row.value, row.least, row.greatest) == (2.0, 1.0, 9.0)
    assert "(1 to 9)" in str(row)
