"""A small picture of the pair, drawn with numpy alone."""

import numpy as np
import numpy.typing as npt

from smad.arrays import Singles
from smad.envs.signals import NAMES

Picture = npt.NDArray[np.uint8]
HEIGHT, WIDTH = 160, 480
_REACH_mm = 10.0
_COLD_C, _HOT_C = 20.0, 80.0
_GROUND, _INK = (250, 250, 248), (40, 44, 52)
_COLD, _HOT, _WANTED = np.array([60, 110, 200]), np.array([210, 60, 40]), (20, 140, 90)
_WALL, _COILS = 12, 9
_AT = {name: i for i, name in enumerate(NAMES)}


def picture(seen: Singles) -> Picture:
    """Springs X (left) and Y, coloured by their RTDs, the block at the displacement, the reference
    as a green mark; shape (160, 480, 3)."""
    image: Picture = np.full((HEIGHT, WIDTH, 3), _GROUND, dtype=np.uint8)
    image[20:-20, :_WALL] = _INK
    image[20:-20, -_WALL:] = _INK
    # X pulls the block to the left where it contracts: displacement is positive then.
    column = _column(float(seen[_AT["displacement_mm"]]))
    _spring(image, _WALL, column - 10, float(seen[_AT["rtd_x_degC"]]))
    _spring(image, column + 10, WIDTH - _WALL, float(seen[_AT["rtd_y_degC"]]))
    image[56:104, max(column - 10, 0) : column + 10] = _INK
    mark = _column(float(seen[_AT["reference_mm"]]))
    image[112:140, max(mark - 2, 0) : mark + 2] = _WANTED
    return image


def _column(position_mm: float) -> int:
    share = min(max(position_mm / _REACH_mm, -1.0), 1.0)
    return round(WIDTH / 2 - share * (WIDTH / 2 - 60))


def _spring(image: Picture, first: int, last: int, t_degC: float) -> None:
    columns = np.arange(first, max(last, first + 1))
    phase = (columns - first) / max(len(columns), 1) * _COILS
    rows = np.rint(80.0 + 22.0 * (2.0 * np.abs(2.0 * (phase % 1.0) - 1.0) - 1.0)).astype(int)
    warm = min(max((t_degC - _COLD_C) / (_HOT_C - _COLD_C), 0.0), 1.0)
    colour = (_COLD + warm * (_HOT - _COLD)).astype(np.uint8)
    for thick in range(-2, 3):
        image[rows + thick, columns] = colour
