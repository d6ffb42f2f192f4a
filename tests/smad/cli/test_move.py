"""`smad move` and the page of commands follow from the kinds of pieces."""

import contextlib
from types import SimpleNamespace
from typing import Annotated, Any

import pytest
from click.testing import CliRunner
from msgspec import Meta

from smad.cli import move as command
from smad.config.axes import millimetres
from smad.control import commands
from smad.control.commands import PIECES, Piece, Ramp, RandomLevels, Samples, Step
from tools import reference


class Triangle(Piece, tag="triangle_wave", frozen=True, kw_only=True):
    """Up and down at a constant speed."""

    height_mm: Annotated[float, Meta(description="from the bottom to the top")]
    rate_mm_per_s: Annotated[float, Meta(description="how fast", extra={"usual": 1.0})]
    rests: Annotated[int, Meta(description="stops at the top")] = 2
    twice: Annotated[bool, Meta(description="do it again", extra={"option": "again"})] = False


@pytest.fixture
def sent(monkeypatch: pytest.MonkeyPatch) -> list[Any]:
    told: list[Any] = []
    monkeypatch.setattr(command, "_send", lambda piece, **how: told.append(piece))
    return told


def run(words: str, group: Any = command.move) -> str:
    result = CliRunner().invoke(group, words.split(), catch_exceptions=False)
    assert result.exit_code == 0, result.output
    return result.output


def test_every_piece_of_single_values_has_a_command_and_points_come_from_a_file() -> None:
    without = [piece for piece in PIECES if command.command_of(piece) is None]
    assert without == [Samples]
    assert len(command.move.commands) == len(PIECES)
    assert "follow" in command.move.commands


def test_what_has_no_default_is_an_argument_and_the_rest_are_options(sent: list[Any]) -> None:
    run("step 3")
    run("step -3 --for 2")
    run("ramp 1 --rate 0.5")
    run("random 2 5 --seed 7")
    assert sent == [
        Step(displacement_mm=3.0, duration_s=10.0),
        Step(displacement_mm=-3.0, duration_s=2.0),
        Ramp(displacement_mm=1.0, rate_mm_per_s=0.5),
        RandomLevels(amplitude_mm=2.0, levels=5, dwell_s=10.0, seed=7),
    ]


def test_a_unit_may_stand_behind_a_number(sent: list[Any]) -> None:
    run("step 5mm --for 2500ms")
    run("step -0.5cm")
    run("ramp 1mm --rate 0.5mm/s")
    assert sent == [
        Step(displacement_mm=5.0, duration_s=2.5),
        Step(displacement_mm=-5.0, duration_s=10.0),
        Ramp(displacement_mm=1.0, rate_mm_per_s=0.5),
    ]


@pytest.mark.parametrize(
    ("words", "says"),
    [
        ("step 60C", "give it in mm, alone or with m, cm, mm, um (µm)"),
        ("step 5.5.5", "is not a number of mm"),
        ("step nan", "is not a finite number"),
        ("step 5mm --deg", "a length in mm contradicts --deg"),
    ],
)
def test_a_unit_of_another_kind_is_refused(words: str, says: str, sent: list[Any]) -> None:
    result = CliRunner().invoke(command.move, words.split())
    assert result.exit_code == 2
    assert says in result.output
    assert sent == []


def test_a_motion_that_no_bench_allows_is_refused_with_the_limit_of_this_one(
    sent: list[Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    bench = SimpleNamespace(config=lambda: "")
    monkeypatch.setattr(command, "client", lambda name: contextlib.nullcontext(bench))
    for words, says in (
        ("step 99", "at most 50 mm; this bench allows up to ±15 mm\n"),
        ("ramp 9 --rate 2000", "at most 1000 mm/s; this bench allows up to 50 mm/s\n"),
        ("sine 1 2 --cycles -1", "'--cycles': -1: it has to be at least 1\n"),
    ):
        result = CliRunner().invoke(command.move, words.split())
        assert says in result.output


def test_degrees_scale_lengths_and_speeds_and_nothing_else(sent: list[Any]) -> None:
    run("ramp 25 --rate 12.5 --deg")
    run("step 25 --for 25 --deg")
    assert sent[0].displacement_mm == pytest.approx(4.0)
    assert sent[0].rate_mm_per_s == pytest.approx(millimetres(12.5))
    assert sent[1].duration_s == 25.0


def test_a_new_kind_of_piece_needs_no_edit_of_the_command_line(sent: list[Any]) -> None:
    made = command.command_of(Triangle)
    assert made is not None
    assert made.name == "triangle-wave"
    run("4 --again --rests 3", made)
    assert sent == [Triangle(height_mm=4.0, rate_mm_per_s=1.0, rests=3, twice=True)]
    told = run("--help", made)
    for words in ("Up and down", "HEIGHT_MM: from the bottom", "--rate MM/S", "Do it again."):
        assert words in told


def test_the_page_lists_every_kind_of_piece(monkeypatch: pytest.MonkeyPatch) -> None:
    assert "triangle_wave" not in reference.pieces()
    assert all(f"({piece.__name__})" in reference.pieces() for piece in PIECES)
    monkeypatch.setattr(commands, "PIECES", (*PIECES, Triangle))
    assert "- **`triangle_wave`** (Triangle)" in reference.pieces()
