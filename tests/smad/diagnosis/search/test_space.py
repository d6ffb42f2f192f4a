"""The coordinates of a fit: scaled, bounded, and turned back into what they stand for."""

import numpy as np
import pytest

from smad.diagnosis.errors import GapError
from smad.diagnosis.plant import Effect, EffectParameter
from smad.diagnosis.search.refine import Space

DRAUGHT = Effect(
    name="draught", title="a draught", signals=("rtd",),
    parameters=(
        EffectParameter(name="more_W_K", unit="W/K", typical=0.05, low=0.0, high=0.3),
        EffectParameter(name="from_degC", unit="degC", typical=0.0, low=-20.0, high=60.0,
                        strength=False),
    ),
)  # fmt: skip


def test_a_shape_that_is_typically_zero_has_a_scale_bounds_and_a_prior() -> None:
    space = Space(DRAUGHT)
    low, high = space.bounds()
    mean, precision = space.prior()
    assert [*low, *high] == pytest.approx([0.0, -0.5, 6.0, 1.5])
    assert list(mean) == [0.0, 0.0]
    assert np.diag(precision) == pytest.approx([1 / 9, 1.0], rel=1e-6)
    assert (space.steps(np.zeros(2)) > 0).all()


def test_coordinates_turn_back_into_the_values_they_stand_for() -> None:
    values = {"more_W_K": 0.1, "from_degC": -12.0}
    space = Space(DRAUGHT)
    assert space.values(space.coordinates(values)) == pytest.approx(values)


@pytest.mark.parametrize(
    ("typical", "low", "high", "strength", "words"),
    [
        (0.0, -1.0, 1.0, True, "typically 0"),
        (1.0, 1.0, 1.0, False, "has no range"),
        (1.0, 2.0, 0.0, True, "has no range"),
        (1.0, float("nan"), 2.0, True, "has no range"),
    ],
)
def test_an_effect_parameter_that_no_fit_could_move_is_refused(
    typical: float, low: float, high: float, strength: bool, words: str
) -> None:
    with pytest.raises(GapError, match=words):
        EffectParameter(name="q", unit="1", typical=typical, low=low, high=high, strength=strength)
