"""What a geometry gives: the paper's spring gives the paper's stroke, others what scaling says."""

import json
from pathlib import Path

import pytest

from sim_device.plant import load_parameters
from sim_device.plant.geometry import Geometry
from smad.cli import execute
from smad.design.cycle import design_cycle

A = load_parameters("A")
PAPER = Geometry(wire_mm=0.75, coil_mm=6.5, turns=20)


def test_the_springs_of_set_a_make_the_stroke_and_force_of_the_paper() -> None:
    made = design_cycle(A, PAPER)
    assert made.stroke_mm == pytest.approx(10.0, rel=0.08)
    assert made.force_hot_N == pytest.approx(1.743, rel=0.05)
    assert made.resistance_Ohm == pytest.approx(0.758, rel=0.01)
    assert made.wire_m == pytest.approx(0.408, rel=0.01)
    assert made.peak_power_W == pytest.approx(4.0**2 * made.resistance_Ohm, rel=0.05)
    heated = 2.0 * made.heating_s / made.period_s
    assert made.power_W == pytest.approx(heated * made.peak_power_W, rel=0.05)
    assert made.outside == ()


def test_twice_the_turns_make_twice_the_stroke_with_the_same_force() -> None:
    one = design_cycle(A, Geometry(wire_mm=0.75, coil_mm=6.5, turns=10))
    two = design_cycle(A, PAPER)
    assert two.stroke_mm == pytest.approx(2.0 * one.stroke_mm, rel=0.02)
    assert two.force_hot_N == pytest.approx(one.force_hot_N, rel=0.02)


def test_turns_that_touch_cool_more_slowly_in_air() -> None:
    closed, open_ = (
        design_cycle(A, Geometry(wire_mm=0.75, coil_mm=6.5, turns=20, pitch_mm=p), cooling="air")
        for p in (0.0, 3.0)
    )
    assert closed.period_s > 1.3 * open_.period_s


def test_a_fan_cools_faster_than_still_air_and_a_bath_needs_more_current() -> None:
    still, blown = (
        design_cycle(A, PAPER, cooling="air", air_m_per_s=speed).period_s for speed in (0.0, 2.0)
    )
    assert 0.17 < blown / still < 0.5  # 2 to 5 times, and up to 8 times, as is published
    assert design_cycle(A, PAPER, current_A=12.0, cooling="bath").period_s < 0.2 * blown


def test_a_wire_that_heats_in_milliseconds_is_switched_off_as_soon_as_it_is_austenite() -> None:
    thin = Geometry(wire_mm=0.1, coil_mm=1.0, turns=20)
    made = design_cycle(A, thin, current_A=2.0, cooling="air")
    assert made.heating_s < 5e-3
    assert made.peak_degC < 50.0


def test_the_command_prints_a_table_or_json_and_writes_a_page(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    page = tmp_path / "design.html"
    assert execute(["design", "--wire", "0.5", "--coil", "3.5", "--report", str(page)]) == 0
    assert "stroke to either side" in capfd.readouterr().out
    assert "shear stress" in page.read_text()
    assert execute(["design", "--json"]) == 0
    assert json.loads(capfd.readouterr().out)["stroke_mm"] > 1.0


def test_the_speed_of_a_fan_and_the_prestrain_take_units(capfd: pytest.CaptureFixture[str]) -> None:
    words = ["design", "--cooling", "air", "--json"]
    made = []
    for typed in (["2", "--prestrain", "0.02"], ["200cm/s", "--prestrain", "2%"]):
        assert execute([*words, "--air-speed", *typed]) == 0
        made.append(json.loads(capfd.readouterr().out))
    assert made[0] == made[1]


def test_options_replace_what_the_file_says(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "mine.toml"
    file.write_text('base = "B"\nwire_mm = 0.75\ncoil_mm = 6.5\nturns = 12\n')
    assert execute(["design", str(file), "--params", "A", "--turns", "20", "--json"]) == 0
    of_file = json.loads(capfd.readouterr().out)
    assert execute(["design", "--json"]) == 0
    of_set = json.loads(capfd.readouterr().out)
    assert of_file.pop("outside") == of_set.pop("outside") == []
    assert of_file == pytest.approx(of_set, rel=1e-6)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--wire", "-1"], "wire_mm: -1 is outside 0.01 to 5"),
        (["nowhere.toml"], "nowhere.toml"),
        (["--current", "0.05"], "does not heat through within 900 s"),
        (["--report", "nowhere/design.html"], "there is no folder nowhere"),
        (["--turns", "0"], "turns: 0 is outside 1 to 200"),
        (["--coil", "0.5"], "coil_mm: 0.5 mm is less than two wires of 0.75 mm"),
        (["--prestrain", "0.05"], "more prestrain than martensite recovers; got prestrain 0.05"),
        (["--prestrain", "0"], "prestrain: 0 is outside 0.0001 to 0.2"),
        (["--air-speed", "2"], "a fan needs air"),
        (["--cooling", "air", "--air-speed", "500"], "a fan this slow or fast is not known"),
        (["--tube", "7"], "the tube around the wire does not fit into the coil"),
        (["--wire", "0.1", "--coil", "1", "--current", "20"], "the wire melts within 10 ms"),
    ],
)
def test_what_cannot_be_designed_is_said_in_one_line(
    arguments: list[str], words: str, capfd: pytest.CaptureFixture[str]
) -> None:
    assert execute(["design", *arguments]) == 1
    (line,) = capfd.readouterr().err.splitlines()
    assert words in line


@pytest.mark.parametrize(
    ("arguments", "starts"),
    [
        (
            ["--wire", "1.2", "--coil", "6.5", "--current", "40"],
            ["wire 1.2 mm", "coil over wire 5.42", "current density 35.4 A/mm²"],
        ),
        (
            ["--cooling", "bath", "--current", "45", "--wire", "0.5", "--coil", "4"],
            ["current density 229 A/mm²", "current 45 A: needs", "current 45 A: left on"],
        ),
        (["--tube", "0.8"], ["tube less wire 0.05 mm: checked from 0.8 to 0.85"]),
        (
            ["--current", "40"],
            [
                "current density 90.5 A/mm²",
                "current 40 A: needs 30.3 V, the supply has 12",
                "current 40 A: left on, it may anneal the wire after 0.22 s",
            ],
        ),
    ],
)
def test_what_lies_outside_the_checked_range_is_said_beside_the_table(
    arguments: list[str], starts: list[str], capfd: pytest.CaptureFixture[str]
) -> None:
    assert execute(["design", *arguments, "--json"]) == 0
    out, err = capfd.readouterr()
    said = json.loads(out)["outside"]
    assert len(said) == len(starts)
    assert all(text.startswith(start) for text, start in zip(said, starts, strict=True))
    assert err.splitlines() == [f"outside what was checked: {text}" for text in said]
