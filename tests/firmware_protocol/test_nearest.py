"""A name that is not known is answered with the nearest, not with all of them."""

import pytest

from campaign.faults.cases import chosen_rows
from firmware_protocol.nearest import instead, nearest
from sim_device.plant.effects.registry import EFFECTS, effect
from sim_device.plant.errors import EffectError
from smad.config import parse_config
from smad.diagnosis.spring_pair.catalogue import timeline_named
from smad.errors import ConfigError, SmadError
from smad.experiments.registry import make_experiment

MANY = [f"name_{k}" for k in range(40)]


def test_a_slip_is_answered_with_the_name_that_is_spelt_like_it() -> None:
    assert instead("tset", ["test", "set", "one"]) == "did you mean set or test?"
    assert nearest("Rtd-Lag", ["rtd_lag", "leak"]) == ["rtd_lag"]


def test_many_names_are_counted_and_few_are_told() -> None:
    assert instead("quux", MANY, "ask lists them") == "there are 40; ask lists them"
    assert instead("quux", ["a", "b"], "ask lists them") == "there are a, b"
    assert instead("quux", []) == "there are none"


def test_an_effect_misspelt_is_answered_with_the_nearest_or_where_to_look() -> None:
    with pytest.raises(EffectError, match="'rtd_lga' is not in the library; did you mean rtd_lag"):
        effect("rtd_lga")
    said = f"there are {len(EFFECTS)}; smad gap effects lists those of each variant"
    with pytest.raises(EffectError, match=said):
        effect("quux")


@pytest.mark.parametrize(
    ("asked", "told"),
    [
        (lambda: make_experiment("fig4-strech"), "did you mean fig4-stretch"),
        (lambda: make_experiment("fig4-stretch", {"strech_mm": 1}), "did you mean stretch_mm"),
        (lambda: timeline_named("heat_stpe"), "did you mean "),
        (lambda: chosen_rows(["stal"]), "did you mean stall"),
        (lambda: parse_config("[recorder]\nautomatc = true"), "did you mean automatic"),
    ],
)
def test_every_place_that_knows_names_answers_with_the_nearest(asked, told: str) -> None:  # type: ignore[no-untyped-def]
    with pytest.raises(SmadError) as refused:
        asked()
    assert told in str(refused.value)
    assert len(str(refused.value)) < 200


def test_a_value_of_the_wrong_type_is_told_with_its_key_and_what_is_allowed() -> None:
    with pytest.raises(ConfigError) as refused:
        parse_config('[recorder]\nautomatic = "yes"')
    assert "recorder.automatic" in str(refused.value)
    assert "got yes; allowed: true or false" in str(refused.value)
