"""What runs would not have shown, in words."""

from smad.diagnosis.plant import EffectParameter
from smad.diagnosis.rivals.unseen import limits_in_words

SKEW = EffectParameter(name="ppm", unit="ppm", typical=300.0, low=0.0, high=2000.0)
RATE = EffectParameter(name="rate_K_s", unit="K/s", typical=0.02, low=-0.5, high=0.5)


def test_a_limit_is_named_once_without_an_exponent_and_the_largest_first() -> None:
    drift = ("ambient_drift", RATE, 0.17)
    assert limits_in_words([drift, ("clock_skew", SKEW, 0.7), drift]) == [
        "clock_skew, ppm: less than 210 ppm",
        "ambient_drift, rate_K_s: less than 0.0034 K/s",
    ]


def test_a_limit_beyond_the_range_is_any_strength() -> None:
    assert limits_in_words([("clock_skew", SKEW, 7.0)]) == ["clock_skew, ppm: any strength"]


def test_a_limit_of_what_is_typically_negative_is_named_up_to_that_end_of_its_range() -> None:
    loss = EffectParameter(name="share", unit="1", typical=-0.1, low=-0.5, high=0.0)
    found = (limits_in_words([("wear", loss, times)]) for times in (2.0, 7.0))
    assert list(found) == [["wear, share: less than 0.2"], ["wear, share: any strength"]]
