"""The repeat floor: what good runs themselves say of what they differ by."""

from dataclasses import replace

import numpy as np
import pytest

from smad.diagnosis.numerics.white import RunRows
from smad.diagnosis.paired.floor import Deviation, Floor, repeat_floor
from smad.diagnosis.plant import Array

BINS, CHANNELS = 400, 2
USUAL = np.array([0.1, 0.4])
"""Spread of a day's parameter, and of what was carried over, before any repeat."""
SHAPE = np.sin(np.linspace(0.0, 9.0, BINS))[:, None] * np.ones(CHANNELS)


def wandering(rng: np.random.Generator, rho: float) -> Array:
    """Noise of unit variance, of which each bin keeps `rho` of the one before; (bins, channels)."""
    fresh = rng.normal(size=(BINS, CHANNELS)) * np.sqrt(1.0 - rho**2)
    out = np.array(rng.normal(size=(1, CHANNELS)).repeat(BINS, axis=0))
    for k in range(1, BINS):
        out[k] = rho * out[k - 1] + fresh[k]
    return out


def repeat(rng: np.random.Generator, *, wrong: float = 0.0, rho: float = 0.8) -> Deviation:
    """A good run in other surroundings, of which the model carried over all but a share `wrong`."""
    carried = rng.normal() * SHAPE
    values = 0.1 * wandering(rng, rho) + wrong * carried
    here = np.ones((BINS, CHANNELS), dtype=bool)
    day = np.array([np.cos(SHAPE), carried])
    return Deviation(values, here, np.zeros((BINS, CHANNELS), dtype=int), day)


def floor_of(repeats: list[Deviation], least: float = 1e-3, degrees: int | None = None) -> Floor:
    return repeat_floor(
        repeats,
        len(repeats) if degrees is None else degrees,
        1,
        least=np.full(CHANNELS, least),
        noise=np.full(CHANNELS, least),
        usual_day=USUAL,
    )


@pytest.mark.parametrize(("wrong", "least", "most"), [(0.02, 0.0, 0.2), (0.4, 0.3, 0.6)])
def test_good_runs_say_how_far_what_was_carried_over_is_off(
    wrong: float, least: float, most: float
) -> None:
    rng = np.random.default_rng(1)
    floor = floor_of([repeat(rng, wrong=wrong) for _ in range(24)])
    assert least <= floor.day_sd[-1] <= most


def test_without_repeats_two_fifths_of_what_was_carried_over_may_be_wrong() -> None:
    assert floor_of([]).day_sd[-1] == USUAL[-1]


@pytest.mark.parametrize(("degrees", "wider"), [(1, 3.0), (2, 3.0), (4, 5.0 / 3.0)])
def test_the_floor_of_few_repeats_is_wider_as_that_of_students_distribution(
    degrees: int, wider: float
) -> None:
    repeats = [repeat(np.random.default_rng(4)) for _ in range(4)]
    few, many = (floor_of(repeats, degrees=n).gauge for n in (degrees, 10**9))
    assert (few / many) ** 2 == pytest.approx(wider)


def test_a_channel_that_no_two_repeats_have_keeps_the_noise_of_its_readings() -> None:
    rng = np.random.default_rng(3)
    repeats = [repeat(rng) for _ in range(4)]
    here = repeats[0].valid.copy()
    here[:, 1] = False
    noise = np.array([0.05, 0.2])
    floor = repeat_floor(
        [replace(d, valid=here) for d in repeats],
        len(repeats),
        1,
        least=0.01 * noise,
        noise=noise,
        usual_day=USUAL,
    )
    assert floor.sd[1] == pytest.approx(noise[1])
    assert floor.sd[0] == pytest.approx(0.1, rel=0.3)


@pytest.mark.parametrize(("rho", "least"), [(0.0, 1e-3), (0.8, 1e-3), (0.99, 1e-3), (0.0, 0.3)])
def test_rows_of_a_good_run_have_unit_variance_in_other_surroundings(
    rho: float, least: float
) -> None:
    """Also where the smallest believed deviation is three times what good runs show."""
    rng = np.random.default_rng(2)
    floor = floor_of([repeat(rng, rho=rho) for _ in range(24)], least)
    squares = []
    for _ in range(24):
        d = repeat(rng, rho=rho)
        rows = RunRows(floor.of(d.regime, d.day), d.valid, d.day, floor.day_sd, floor.rho)
        squares.append(rows.shrink(rows.independent(d.values[None])) ** 2)
    assert np.sqrt(np.mean(squares)) == pytest.approx(1.0, abs=0.15)
