"""What in a column is no reading, and the unit that values beyond a range are likely to be in."""

import numpy as np
import pytest

from smad.records.declared import Declared
from smad.records.readings import checked, checked_columns, doubted_step, on_lines, rows_each
from smad.records.units import Written

T = np.arange(400) * 0.1
WARM = Declared(name="T", unit="degC", low=-20.0, high=120.0)


def course() -> np.ndarray:
    """A reading that swings by 40 degrees, with noise."""
    noise = np.random.default_rng(0).standard_normal(len(T))
    return 45.0 + 20.0 * np.sin(T / 3.0) + 0.1 * noise


def applied(unit: str, low: float, high: float) -> Declared:
    return Declared(name="u", unit=unit, low=low, high=high, applied=True)


def test_a_reading_without_a_fault_is_left_as_it_is() -> None:
    found = checked(course(), WARM, T, np.ones(len(T), dtype=bool))
    assert (found.notes, found.refusal, found.share) == ((), "", 0.0)
    np.testing.assert_array_equal(found.values, course())


@pytest.mark.parametrize("code", [-127.0, 85.0, 9999.0, -9999.0, 32767.0, 1e30])
def test_a_code_is_taken_out_and_told_with_its_count_and_time(code: float) -> None:
    y = course()
    y[[50, 51, 300]] = code
    found = checked(y, WARM, T)
    assert np.flatnonzero(np.isnan(found.values)).tolist() == [50, 51, 300]
    assert found.notes == (f"T holds {code:g} in 3 samples (the first at 5 s): a code, no reading",)


def test_a_number_too_large_to_be_rounded_is_a_code_and_no_warning_of_the_arithmetic() -> None:
    y = course()
    y[50] = 1e308
    with np.errstate(over="raise"):
        found = checked(y, WARM, T)
    assert np.flatnonzero(np.isnan(found.values)).tolist() == [50]
    assert "a code, no reading" in found.notes[0]


@pytest.mark.parametrize("code", [-999.0, 9999.0, 65535.0])
def test_a_code_is_looked_for_among_the_numbers_of_the_file(code: float) -> None:
    milliamperes = Written.of("mA", "A")
    declared = Declared(name="i", unit="A", low=-70.0, high=70.0, written=milliamperes)
    i = 2.0 + 0.01 * np.random.default_rng(0).standard_normal(len(T))
    i[[50, 51, 300]] = code * 1e-3
    found = checked(i, declared, T)
    assert np.flatnonzero(np.isnan(found.values)).tolist() == [50, 51, 300]
    assert found.notes == (
        f"i holds {code:g} mA in 3 samples (the first at 5 s): a code, no reading",
    )


def test_a_column_beyond_its_range_is_told_in_the_numbers_of_its_file() -> None:
    declared = Declared(name="i", unit="A", low=0.0, high=4.0, written=Written.of("mA", "A"))
    refusal = checked(np.linspace(0.0, 90.0, len(T)), declared, T).refusal
    assert refusal.startswith("i holds 0 to 90000 mA, declared 0 to 4 A: in uA?")


def test_no_code_is_looked_for_in_a_column_that_is_refused() -> None:
    i = np.rint(np.linspace(0.0, 4000.0, len(T)))
    i[[50, 51, 300]] = 999.0, 999.0, 85.0
    found = checked(i, Declared(name="i", unit="A", low=0.0, high=4.0, applied=True), T)
    assert found.refusal.startswith("i holds 0 to 4000, declared 0 to 4 A: in mA?")
    assert found.notes == ()


@pytest.mark.parametrize(
    ("at_once", "advice"), [(True, "its sensor open?"), (False, "hold = true")]
)
def test_a_reading_that_lacks_a_third_is_asked_about_by_how_it_lacks_them(
    at_once: bool, advice: str
) -> None:
    n = np.arange(len(T))
    lacking = n < len(T) // 3 if at_once else n % 3 == 0
    _, remarks = checked_columns({"T": np.where(lacking, np.nan, course())}, [WARM], T)
    (sparse,) = [r for r in remarks if r.kind == "sparse"]
    assert sparse.text.endswith(f"of {len(T)} samples only ({len(T) * 4 // 5} are needed)")
    assert advice in sparse.advice


@pytest.mark.parametrize(("rows", "noise"), [(2, 0.1), (5, 0.1), (5, 0.0), (20, 0.1)])
def test_a_reading_that_several_rows_repeat_is_read_between_the_first_of_each(
    rows: int, noise: float
) -> None:
    true = 45.0 + 20.0 * np.sin(T / 3.0) + noise * np.random.default_rng(0).standard_normal(len(T))
    y = np.repeat(true[::rows], rows)[: len(T)]
    steady, changing = np.ones(len(T), dtype=bool), np.zeros(len(T), dtype=bool)
    assert rows_each(true, steady, changing) == 1
    assert rows_each(y, steady, changing) == (rows if len(T) > 20 * rows else 1)
    read = on_lines(y, rows)
    np.testing.assert_array_equal(read[::rows], true[::rows])
    # What an input holds is no slow sensor's.
    assert rows_each(y, steady, np.diff(y, prepend=np.nan) != 0.0) == 1


def test_a_slow_course_in_coarse_steps_is_not_repeated() -> None:
    y = np.round(20.0 + 2.0 * T, 0)
    everywhere = np.ones(len(T), dtype=bool)
    assert rows_each(y, everywhere, ~everywhere) == 1


@pytest.mark.parametrize(
    ("step_s", "words"),
    [(0.01, ""), (10.0, "is the time in ms?"), (1e4, "in us?"), (30e10, "correct the time")],
)
def test_a_step_that_makes_no_sense_is_asked_with_the_likely_unit(
    step_s: float, words: str
) -> None:
    said = doubted_step(np.arange(5) * step_s, 1.0)
    assert words in said
    assert bool(words) == bool(said)


def test_a_reading_that_goes_through_85_degrees_keeps_it() -> None:
    y = np.round(np.linspace(60.0, 110.0, len(T)), 0)
    assert (y == 85.0).any()
    assert checked(y, WARM, T).notes == ()


def test_a_code_that_is_no_usual_one_is_known_by_its_repeating() -> None:
    y = course()
    y[::20] = -55.0
    assert checked(y, WARM, T).notes == (
        "T holds -55 in 20 samples (the first at 0 s): a code, no reading",
    )


def test_a_step_of_a_reading_is_no_jump() -> None:
    y = np.where(T > 20.0, 80.0, 20.0)
    assert checked(y, WARM, T, np.ones(len(T), dtype=bool)).notes == ()


def test_noise_beyond_the_end_of_a_range_is_none_of_it() -> None:
    u = np.where(T > 20.0, 100.0, 0.0) + 0.5 * np.sin(T)
    assert checked(u, applied("pct", 0.0, 100.0), T).refusal == ""


@pytest.mark.parametrize(
    ("declared", "factor", "words"),
    [
        (applied("pct", 0.0, 100.0), 2.55, "0 to 204, declared 0 to 100 pct: counts of 8 bits? "
         "give `scale = 0.392157`"),
        (applied("1", 0.0, 1.0), 2.55, "0 to 1: counts of 8 bits? give `scale = 0.00392157`"),
        (applied("1", 0.0, 1.0), 1.0, "percent? give `scale = 0.01`"),
        (applied("A", 0.0, 4.0), 18.75, "in mA? say so, in the name of its column"),
        (applied("A", 0.0, 4.0), -0.05, "holds -4 to -0, declared 0 to 4 A: is its sign reversed?"),
        (applied("V", 0.0, 10.0), 12.7875, "counts of 10 bits? give `scale = 0.00977517`"),
        (applied("degC", 0.0, 300.0), -3.0, "-240 to -0, declared 0 to 300 degC: does it go both"),
        (applied("rpm", 0.0, 10.0), 1e7, "correct the column, its unit, or the range"),
    ],
)  # fmt: skip
def test_an_input_beyond_its_range_is_refused_with_values_range_and_likely_unit(
    declared: Declared, factor: float, words: str
) -> None:
    u = np.rint(np.where(T > 20.0, 80.0, 0.0) * factor * 1000) / 1000
    refusal = checked(u, declared, T).refusal
    assert refusal.startswith("u holds ")
    assert words in refusal
    assert "\n" not in refusal


def test_an_input_that_goes_both_ways_is_not_clipped_but_refused() -> None:
    refusal = checked(np.sin(T) * 5.0, applied("A", 0.0, 4.0), T).refusal
    assert "does it go both ways? declare its range so" in refusal


def test_a_reading_that_stays_the_same_between_noise_is_stuck_and_told() -> None:
    y = 45.0 + 5.0 * np.sin(T / 10.0) + 0.1 * np.random.default_rng(0).standard_normal(len(T))
    y[120:180] = y[119]
    found = checked(y, WARM, T)
    assert np.flatnonzero(np.isnan(found.values)).tolist() == list(range(119, 180))
    assert found.notes == (
        f"T stays at {y[119]:g} for 61 samples (from 11.9 to 17.9 s) and is noisy beside them: "
        "stuck",
    )


@pytest.mark.parametrize("kind", ["clipped", "off", "no noise", "hunting", "slower", "at rest"])
def test_a_reading_that_may_well_stay_the_same_is_not_stuck(kind: str) -> None:
    y, n = course(), len(T)
    noise = np.random.default_rng(1).standard_normal(n)
    y = {
        "clipped": np.clip(y, 30.0, 60.0),
        "off": np.where((T > 10.0) & (T < 20.0), 0.0, 2.0 * noise),
        "no noise": np.where(T < 20.0, 20.0, 20.0 + 5.0 * (T - 20.0)),
        # A loop that hunts by one count of an encoder, until friction holds it.
        "hunting": np.where((T > 10.0) & (T < 20.0), 3.0, 3.0 + np.rint(0.5 * noise)),
        "slower": np.repeat(y[::20], 20),
        "at rest": np.round(22.0 + 0.3 * np.maximum(T - 20.0, 0.0) + 0.02 * noise, 1),
    }[kind]
    assert checked(y, WARM, T).notes == ()


@pytest.mark.parametrize(("value", "samples"), [(0.0, 3), (-3.0, 20), (119.0, 6)])
def test_a_reading_that_leaps_to_a_value_and_back_was_none(value: float, samples: int) -> None:
    y, steady = course(), np.ones(len(T), dtype=bool)
    y[200 : 200 + samples] = value
    found = checked(y, WARM, T, steady)
    assert np.flatnonzero(np.isnan(found.values)).tolist() == list(range(200, 200 + samples))
    end = 20 + (samples - 1) / 10
    assert found.notes == (
        f"T stays at {value:g} for {samples} samples (from 20 to {end:g} s), leaps there and back: "
        "no reading",
    )
    # An input steps there: a relay may have switched.
    steady[198:203] = False
    assert checked(y, WARM, T, steady).notes == ()


def test_codes_that_are_one_in_fifty_are_jumps_nevertheless() -> None:
    y = course()
    y[25::50] = -19.0
    found = checked(y, WARM, T, np.ones(len(T), dtype=bool))
    assert np.flatnonzero(np.isnan(found.values)).tolist() == list(range(25, len(T), 50))


def rising(stuck: int, *, noise: float, quantum: float, start: int = 150) -> np.ndarray:
    """A plate that warms and cools at 5 Hz, its reading stuck for some samples."""
    rng = np.random.default_rng(3)
    y = 40.0 + 20.0 * np.sin(np.arange(300) / 40.0) + noise * rng.standard_normal(300)
    y = np.round(y / quantum) * quantum
    y[start : start + stuck] = y[start]
    return y


@pytest.mark.parametrize("quantum", [0.01, 0.1, 0.25])
@pytest.mark.parametrize("stuck", [12, 20, 40])
def test_a_short_stretch_is_stuck_where_the_reading_then_jumps(stuck: int, quantum: float) -> None:
    y = rising(stuck, noise=0.03, quantum=quantum)
    found = checked(y, WARM, T[:300], np.ones(300, dtype=bool))
    lost = np.flatnonzero(np.isnan(found.values))
    assert set(range(151, 150 + stuck)) <= set(lost.tolist()) <= set(range(148, 152 + stuck))
    assert "jumps afterwards: stuck" in found.notes[0]


def test_each_stretch_in_which_a_reading_is_stuck_is_told() -> None:
    y = rising(20, noise=0.03, quantum=0.01, start=90)
    y[200:220] = y[200]
    notes = checked(y, WARM, T[:300], np.ones(300, dtype=bool)).notes
    assert [note.split(" for ")[1].split(" (")[0] for note in notes] == ["20 samples", "20 samples"]


def test_a_reading_that_stays_to_the_end_of_its_run_is_not_known_to_be_stuck() -> None:
    y = rising(150, noise=0.03, quantum=0.01)
    assert checked(y, WARM, T[:300], np.ones(300, dtype=bool)).notes == ()


def test_a_reading_that_jumps_with_an_input_was_at_rest() -> None:
    y = rising(20, noise=0.0, quantum=0.01)
    steady = np.ones(300, dtype=bool)
    steady[165:176] = False
    assert checked(y, WARM, T[:300], steady).notes == ()


def test_columns_of_five_samples_are_looked_at_as_long_ones_are() -> None:
    declared = [applied("A", 0.0, 4.0), WARM]
    columns = {"u": np.array([0.0, 0.0, 2.0, 2.0, np.nan]), "T": np.full(5, 20.0)}
    checked_out, remarks = checked_columns(columns, declared, T[:5])
    np.testing.assert_array_equal(checked_out["u"], columns["u"])
    assert [r.text for r in remarks] == ["u without a number in 1 of 5 samples"]


def test_a_remark_on_gaps_names_three_columns_and_counts_the_rest() -> None:
    columns = {name: np.array([0.0, np.nan, 2.0, 1.0, 3.0]) for name in ("a", "b", "c", "d", "e")}
    _, remarks = checked_columns(columns, [], T[:5])
    assert [r.text for r in remarks] == ["a, b, c and 2 more without a number in 1 of 5 samples"]
