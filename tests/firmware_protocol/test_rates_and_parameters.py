"""What a line can carry, and what a parameter may be."""

import pytest

from firmware_protocol import rates
from firmware_protocol.enums import ErrorCode
from firmware_protocol.errors import RateError
from firmware_protocol.parameters import (
    BY_NAME,
    LIMIT_PARAMETERS,
    PARAMETERS,
    DamagedImageError,
    ParameterRefusedError,
    ParameterStore,
)
from firmware_protocol.supervisor.limits import LIMIT_ROWS, compiled_limits


def test_a_hundred_hertz_take_about_55_percent_of_115200() -> None:
    assert rates.check(100, 115_200).share == pytest.approx(0.55, abs=0.02)


@pytest.mark.parametrize(
    ("rate_hz", "baud", "axes", "suggestions"),
    [
        (250, 115_200, 1, ["250 Hz at 230400 Bd", "100 Hz at 115200 Bd"]),
        (500, 115_200, 1, ["500 Hz at 460800 Bd", "100 Hz at 115200 Bd"]),
        (500, 230_400, 1, ["500 Hz at 460800 Bd", "250 Hz at 230400 Bd"]),
        (100, 9_600, 1, ["100 Hz at 115200 Bd"]),
        (500, 921_600, 6, ["500 Hz at 3000000 Bd", "100 Hz at 921600 Bd"]),
        (500, 3_000_000, 60, ["fewer axes"]),
    ],
)
def test_a_pair_that_does_not_fit_is_refused_with_pairs_that_do(
    rate_hz: int, baud: int, axes: int, suggestions: list[str]
) -> None:
    with pytest.raises(RateError) as caught:
        rates.check(rate_hz, baud, axes)
    message = str(caught.value)
    assert all(words in message for words in ["70%", str(baud), *suggestions])
    for words in suggestions:
        if "Hz" in words:
            rate, fast_enough = (int(word) for word in words.split() if word.isdigit())
            rates.check(rate, fast_enough, axes)


def test_a_port_without_a_baud_rate_carries_everything() -> None:
    assert rates.check(500, 0, 6).share == 0.0
    assert rates.most_rate_hz(0) == 500
    assert rates.most_rate_hz(115_200) == 100
    assert rates.most_rate_hz(9_600) == 0


def test_parameter_numbers_and_names_are_unique_and_initial_values_allowed() -> None:
    assert len({p.number for p in PARAMETERS}) == len(PARAMETERS) == len(BY_NAME)
    store = ParameterStore(2)
    for (axis, number), value in dict(store.values).items():
        store.set(axis, number, value)
    assert ParameterStore(2).crc == store.crc != ParameterStore(1).crc


def test_every_limit_that_may_be_tightened_is_a_parameter_and_none_may_be_loosened() -> None:
    assert {p.name for p in LIMIT_PARAMETERS} == {n for n, row in LIMIT_ROWS.items() if row.number}
    store = ParameterStore()
    assert store.limits() == compiled_limits()
    for parameter in LIMIT_PARAMETERS:
        row = LIMIT_ROWS[parameter.name]
        looser = row.compiled + (1 if row.compiled >= row.tightest else -1)
        with pytest.raises(ParameterRefusedError, match=parameter.name):
            store.set(0, parameter.number, looser)
        store.set(0, parameter.number, row.tightest)
        assert getattr(store.limits(), parameter.name) == row.tightest


def test_a_refused_value_names_parameter_value_and_range() -> None:
    with pytest.raises(ParameterRefusedError) as caught:
        ParameterStore().set(0, BY_NAME["state_rate_hz"].number, 300)
    assert "state_rate_hz = 300 Hz" in str(caught.value)
    assert "100, 250, 500" in str(caught.value)
    assert (caught.value.code, caught.value.value) == (ErrorCode.OUT_OF_RANGE, 300)


def test_a_shared_parameter_belongs_to_axis_zero_alone() -> None:
    store = ParameterStore(2)
    store.set(0, BY_NAME["state_rate_hz"].number, 250)
    assert store.get("state_rate_hz", axis=1) == 250
    with pytest.raises(ParameterRefusedError, match="no parameter"):
        store.set(1, BY_NAME["state_rate_hz"].number, 100)


@pytest.mark.parametrize("name", ["encoder_nm_per_count", "force_uN_per_count"])
def test_a_scale_may_have_either_sign_and_is_never_zero(name: str) -> None:
    store = ParameterStore()
    number = BY_NAME[name].number
    for value in (-1, 1):
        store.set(0, number, value)
    with pytest.raises(ParameterRefusedError, match="not 0"):
        store.set(0, number, 0)
    old = ParameterStore()
    old.values[0, number] = 0
    store.load(old.image())
    assert store.get(name) == 1


def test_a_stored_image_brings_the_values_back() -> None:
    store = ParameterStore(2)
    store.set(1, BY_NAME["force_uN_per_count"].number, -77)
    other = ParameterStore(2)
    other.load(store.image())
    assert other.values == store.values


def test_an_image_with_any_bit_wrong_or_missing_is_refused_and_changes_nothing() -> None:
    store = ParameterStore()
    store.set(0, BY_NAME["current_limit_mA"].number, 1234)
    image = store.image()
    damaged = [image[:-1], image[1:], b"", b"\xff" * len(image)]
    for bit in range(0, 8 * len(image), 5):
        flipped = bytearray(image)
        flipped[bit // 8] ^= 1 << bit % 8
        damaged.append(bytes(flipped))
    for bad in damaged:
        fresh = ParameterStore()
        with pytest.raises(DamagedImageError, match="CRC"):
            fresh.load(bad)
        assert fresh.values == ParameterStore().values


def test_an_image_of_another_version_keeps_what_still_fits() -> None:
    old = ParameterStore(3)
    old.values[0, 9999] = 5
    old.values[0, BY_NAME["current_limit_mA"].number] = 999_999
    old.values[0, BY_NAME["encoder_nm_per_count"].number] = 42
    new = ParameterStore(1)
    new.load(old.image())
    assert new.get("encoder_nm_per_count") == 42
    assert new.get("current_limit_mA") == BY_NAME["current_limit_mA"].default
