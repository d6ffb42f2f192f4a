"""Rivals, and values of effects, in words."""

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from smad.diagnosis.rivals.describe import effect_values, rival_words
from smad.diagnosis.rivals.parts import EffectPart
from smad.diagnosis.rivals.rival import Rival
from smad.diagnosis.rivals.score import NOTHING, PARAMETERS
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


@pytest.mark.parametrize(
    ("name", "words"),
    [(NOTHING, "day-to-day variation alone"), (PARAMETERS, "parameters alone")],
)
def test_nothing_more_beside_parameters_that_have_entered_is_parameters_alone(
    name: str, words: str
) -> None:
    fit = cast(Any, SimpleNamespace(model=SimpleNamespace(parts=())))
    rival = Rival(kind=NOTHING, name=name, fit=fit, squares=np.ones((1, 1)), scores=np.zeros(1))
    assert rival_words(cast(Any, None), rival) == words
