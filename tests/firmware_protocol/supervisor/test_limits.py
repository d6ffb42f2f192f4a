"""The limits table, the host's share of it, the fault texts, and what is generated from all."""

import subprocess
import sys

import pytest

from firmware_protocol.enums import Fault
from firmware_protocol.parameters import BY_NAME, ParameterStore
from firmware_protocol.supervisor import (
    CHECKS,
    FAULT_TEXTS,
    LIMIT_ROWS,
    LimitError,
    c_source,
    compiled_limits,
    explain,
    ranges,
    soft_range,
    tighten,
)
from firmware_protocol.supervisor import document as safety
from firmware_protocol.supervisor.errors import DocumentError, TranslationError
from firmware_protocol.supervisor.generate import generated, stale
from firmware_protocol.supervisor.host import HOST_ROWS, host_limits
from smad.config import LimitsConfig

SOFT = [name for name, row in LIMIT_ROWS.items() if row.number]


@pytest.mark.parametrize("name", SOFT)
def test_a_stored_limit_may_tighten_the_compiled_one_and_never_loosen_it(name: str) -> None:
    row = LIMIT_ROWS[name]
    tightened = tighten(compiled_limits(), {name: row.tightest})
    assert getattr(tightened, name) == row.tightest
    looser = row.compiled + (1 if row.compiled > row.tightest else -1)
    with pytest.raises(LimitError, match=f"{name} = {looser} .*compiled {row.compiled}"):
        tighten(compiled_limits(), {name: looser})


def test_a_limit_without_a_parameter_is_fixed() -> None:
    for name, row in LIMIT_ROWS.items():
        if not row.number:
            assert soft_range(name) == (row.compiled, row.compiled)
            with pytest.raises(LimitError):
                tighten(compiled_limits(), {name: row.compiled + 1})


def test_an_unknown_limit_is_refused_by_name() -> None:
    with pytest.raises(LimitError, match="'colour'"):
        tighten(compiled_limits(), {"colour": 1})


def test_every_soft_limit_is_a_parameter_of_the_board() -> None:
    for name in SOFT:
        parameter = BY_NAME[name]
        assert (parameter.minimum, parameter.maximum) == soft_range(name)
        assert parameter.default == LIMIT_ROWS[name].compiled
    numbers = [LIMIT_ROWS[name].number for name in SOFT]
    assert len(set(numbers)) == len(numbers)


def test_a_fresh_store_gives_the_compiled_limits() -> None:
    assert ParameterStore(1).limits() == compiled_limits()


def test_every_limit_fits_a_parameter_and_has_a_reason() -> None:
    for name, row in LIMIT_ROWS.items():
        assert abs(row.compiled) < 1 << 31, name
        assert abs(row.tightest) < 1 << 31, name
        assert len(row.reason) > 8, name


def test_every_limit_a_check_names_exists() -> None:
    for check in CHECKS:
        assert check.samples in LIMIT_ROWS
        assert not check.time or check.time in LIMIT_ROWS
        assert safety._LIMIT_NAME.sub("", check.trips_when)
        assert all(name in LIMIT_ROWS for name in safety._LIMIT_NAME.findall(check.trips_when))


def test_an_over_current_is_one_that_the_sense_can_still_show() -> None:
    # The INA240 goes to 0.2 V below its supply, which is the converter's reference too.
    limits, supply_V = compiled_limits(), 4.5
    most_mA = 5000 * (supply_V - 0.2) / supply_V
    assert (
        limits.current_limit_mA * 1.1 + limits.current_error_mA < limits.over_current_mA < most_mA
    )


def test_temperatures_stand_in_the_order_in_which_they_protect() -> None:
    limits = compiled_limits()
    host = host_limits(limits)
    assert (
        limits.cold_cC
        < host.temperature_cC
        < limits.fold_start_cC
        < limits.fold_end_cC
        < limits.temperature_limit_cC
        < 10_000
        < limits.rail_high_cC
    )


@pytest.mark.parametrize("name", HOST_ROWS)
def test_the_host_is_never_looser_than_the_board(name: str) -> None:
    limits = compiled_limits()
    board = getattr(limits, HOST_ROWS[name].board)
    host = getattr(host_limits(limits), name)
    if name == "supply_mV":
        assert host >= board
    else:
        assert host <= board


def test_the_daemons_own_limits_are_within_the_hosts_share() -> None:
    own, host = LimitsConfig(), host_limits(compiled_limits())
    assert own.temperature_max_degC * 100 <= host.temperature_cC
    assert own.on_time_max_s <= host.on_time_s


def test_the_host_follows_a_board_that_was_tightened() -> None:
    tightened = tighten(compiled_limits(), {"fold_start_cC": 6000})
    assert host_limits(tightened).temperature_cC == 5940


@pytest.mark.parametrize("fault", list(Fault))
def test_every_fault_is_explained_with_cause_and_remedy(fault: Fault) -> None:
    text = FAULT_TEXTS[fault]
    assert text.cause.endswith(".")
    assert text.remedy.endswith(".")
    assert explain(fault) == f"{fault.name}: {text.cause} {text.remedy}"


def test_the_generated_files_are_not_stale() -> None:
    assert stale() == []
    assert {path.name for path in generated()} == {
        "smad_supervisor.h",
        "smad_supervisor.c",
        "safety.md",
    }


def test_the_check_mode_is_quiet_about_fresh_files() -> None:
    done = subprocess.run(
        [sys.executable, "-m", "firmware_protocol.supervisor.generate", "--check"],
        capture_output=True,
        text=True,
        check=False,
    )
    assert (done.returncode, done.stderr) == (0, "")


def test_a_damaged_marker_in_the_document_is_refused() -> None:
    with pytest.raises(DocumentError, match="diagram"):
        safety.fill("<!-- generated: nonsense -->\n<!-- end -->")


def test_the_core_cannot_grow_out_of_what_c_can_do() -> None:
    from firmware_protocol.supervisor.translate import Translator

    from . import untranslatable

    translator = Translator(untranslatable, c_source.names())
    for function in untranslatable.FUNCTIONS:
        with pytest.raises(TranslationError, match="untranslatable, line"):
            translator.definition(function, public=False)


def test_a_field_without_a_range_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delitem(ranges.MEMORY, "started")
    with pytest.raises(TranslationError, match="started of memory has no range"):
        c_source.header()


@pytest.mark.parametrize(
    ("value", "unit", "text"),
    [
        (9500, "cC", "95 °C"),
        (20_000, "us", "20 ms"),
        (12_000_000, "us", "12 s"),
        (7500, "mV", "7.5 V"),
        (20_000, "mJ", "20 J"),
        (100, "permille", "10 %"),
        (30, "cC/s", "0.3 K/s"),
        (4000, "mA", "4000 mA"),
        (3, "samples", "3 samples"),
    ],
)
def test_limits_are_shown_in_units_people_use(value: int, unit: str, text: str) -> None:
    assert safety.in_words(value, unit) == text
