"""Records of the kernel: named, of plain numbers, and filled by name."""

from typing import Annotated

import numpy as np
import pytest

from sim_device.plant import kernel as k
from sim_device.plant.kernel.layout import dtype_of, places


class Point:
    x: float
    y: float


class Track:
    length: float
    start: Point
    corners: Annotated[list[Point], 3]
    weights: Annotated[list[float], 2]


def test_a_record_reads_and_writes_the_row_of_its_numbers():
    tracks = k.zeros(Track)
    row = k.numbers(tracks)
    assert row.shape == (1 + 2 + 6 + 2,)
    tracks[0].corners[1].y = 7.0
    assert row[1 + 2 + 3] == 7.0
    row[k.place_of(Track, "start.y")] = 5.0
    assert tracks[0].start.y == 5.0


def test_a_copy_is_apart_from_its_original():
    tracks = k.zeros(Track)
    other = k.copied(tracks)
    other[0].weights[0] = 1.0
    assert not k.numbers(tracks).any()


def test_only_single_numbers_have_a_place():
    assert places(Track) == {"length": 0}
    for path in ("corners", "start.z", "start.x.y"):
        with pytest.raises(KeyError):
            k.place_of(Track, path)


def test_filling_takes_every_number_by_name_and_no_other():
    assert k.filled(Point, {"y": 2.0, "x": 1.0})[0].x == 1.0
    with pytest.raises(TypeError, match="y"):
        k.filled(Point, {"x": 1.0})
    with pytest.raises(TypeError, match="z"):
        k.filled(Point, {"x": 1.0, "y": 2.0, "z": 3.0})


def test_a_name_that_plain_python_would_not_see_is_refused():
    hidden = type("Hidden", (), {"__annotations__": {"T": float}})
    with pytest.raises(TypeError, match="rename"):
        dtype_of(hidden)


def test_state_and_model_are_of_numbers_without_gaps():
    for layout in (k.State, k.Work, k.Model):
        row = k.numbers(k.zeros(layout))
        assert row.dtype == np.float64
        assert row.size * 8 == dtype_of(layout).itemsize
