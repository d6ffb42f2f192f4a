"""Values of effects in words."""

import numpy as np
import pytest

from smad.diagnosis.rivals.describe import effect_values
from smad.diagnosis.rivals.parts import EffectPart
from tests.smad.diagnosis.heater_plant import EFFECTS

LAG = EffectPart(EFFECTS[0])


@pytest.mark.parametrize(
    ("lag_s", "text"),
    [
        (0.0, "tau_s = 0.00 ± 0.06 s"),
        (3.0, "tau_s = 3.00 ± 0.06 s"),
        (6.0, "tau_s = 6.00 ± 0.06 s (at the end of its range)"),
    ],
)
def test_a_strength_as_large_as_it_may_be_says_so(lag_s: float, text: str) -> None:
    x = LAG.coordinates({"tau_s": lag_s})
    (value,) = effect_values(LAG, x, np.array([0.04]))
    assert value.text == text
