"""Numbers that the handbook gives of the diagnosis are those of the code."""

from __future__ import annotations

from pathlib import Path

import pytest

from evaluation.calibrate.fitting import HELD
from evaluation.calibrate.rivals import LISTED, UNLISTED
from evaluation.programme.separations import Limits
from evaluation.score.answers import NAMED
from sim_device.plant.laws import LAGS_S
from smad.checkup.proposal import SEPARATED
from smad.diagnosis import constants, questions
from smad.diagnosis.data import grid, noise
from smad.diagnosis.plant import Traits
from smad.diagnosis.rivals import changes, evidence, laws, rival, score, screening, search
from smad.diagnosis.verdict import AT_FLOOR
from smad.records import readings

ROOT = Path(__file__).resolve().parents[3]
DIAGNOSIS, GUIDE, CHECK_UP, TRUST, EVALUATION = (
    "docs/diagnosis.md",
    "docs/guide/diagnose-a-gap.md",
    "docs/guide/check-up.md",
    "docs/trust.md",
    "evaluation/README.md",
)
NUMBERS = {2: "two", 3: "three", 4: "four", 5: "fifth", 8: "eight", 10: "ten"}
WEAK, TYPICAL = changes._LEVELS
SHORT_S, LONG_S = LAGS_S
MOST = Limits()

CLAIMS = [
    (DIAGNOSIS, f"and {100 * noise.RESOLUTION:g} % of its swing"),
    (DIAGNOSIS, f"more beyond {grid.MOST_ROWS} rows; in a check-up over {grid.PERIOD_S} s"),
    (DIAGNOSIS, f"at most {NUMBERS[laws.MOST_TERMS]} functions"),
    (DIAGNOSIS, f"lags of {SHORT_S:g} and {LONG_S:g} s"),
    (DIAGNOSIS, f"fewer than {NUMBERS[evidence._FOLDS]} runs"),
    (DIAGNOSIS, f"at {WEAK:g} and {TYPICAL:g} times its typical strength"),
    (DIAGNOSIS, f"the {screening._TRIED} best effects"),
    (DIAGNOSIS, f"with {NUMBERS[screening._ROUNDS]} rounds of a fit"),
    (DIAGNOSIS, f"the {NUMBERS[screening._MOST]} best, all effects"),
    (DIAGNOSIS, f"and {NUMBERS[search._LAWS]} laws"),
    (DIAGNOSIS, f"= {evidence.CORRELATED:g} rows count as one"),
    (DIAGNOSIS, f"until no signal has more than {AT_FLOOR} floors"),
    (DIAGNOSIS, f"more than {score._QUIET_SQUARE**0.5:g} floors over all signals"),
    (DIAGNOSIS, f"in {100 * (1 - score._FORM_RARELY):g} of 100 cases"),
    (DIAGNOSIS, f"the spring pair's {NUMBERS[rival.CHANNELS]} channels"),
    (DIAGNOSIS, f"(by {constants._EFFECTS} effects and {score._LAWS} laws at least)"),
    (DIAGNOSIS, f"for {NUMBERS[search.MOST_CAUSES]} parts at most"),
    (DIAGNOSIS, f"up to {NUMBERS[questions._MOST_OF_GOOD]} causes"),
    (DIAGNOSIS, f"up to {NUMBERS[search.MOST_CAUSES]} effects"),
    (DIAGNOSIS, f"probability above {1 - constants.shipped().credible_level:.2f}"),
    (GUIDE, f"A run needs {Traits().shortest_s:g} s and {grid.LEAST_PERIODS} [rows]"),
    (GUIDE, f"lacks a {NUMBERS[round(1 / readings._MOST_MISSING)]} of its samples"),
    (
        CHECK_UP,
        f"below {MOST.temperature_degC:g} °C, {MOST.displacement_mm:g} mm and {MOST.force_N:g} N",
    ),
    (CHECK_UP, f"rows of {grid.PERIOD_S} s"),
    (CHECK_UP, f"(d² ≥ {SEPARATED:g}, every whitened row"),
    (TRUST, f"A name is given from a probability of {NAMED} on"),
    (
        EVALUATION,
        f"hold the truth in {HELD[LISTED]} of the noticed listed effects and {HELD[UNLISTED]} of",
    ),
    (EVALUATION, f"from a probability of {NAMED} on"),
]


@pytest.mark.parametrize(("page", "claim"), CLAIMS)
def test_a_number_of_the_handbook_is_that_of_the_code(page: str, claim: str) -> None:
    assert claim in (ROOT / page).read_text(encoding="utf-8")
