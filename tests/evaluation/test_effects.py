"""Every effect acts, acts more when stronger, is gone at zero, and fades in without a jump."""

import re
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from evaluation.bank.making import SIGNALS
from evaluation.bank.recorder import Run, record
from evaluation.plant.effect import Effect
from evaluation.plant.effects import EFFECTS, Active, magnitudes, names
from evaluation.plant.kernel import simulate
from evaluation.plant.own import own_differences
from evaluation.plant.parameters import Bench
from evaluation.plant.spent import DROPPED

Array = NDArray[np.float64]

SCALE = np.array([2.3e-3, 2.3e-3, 2.3e-3, 2.3e-3, 0.05, 0.05, 0.03, 2.5e-3])
"""About the noise of each of `SIGNALS`."""
TRUTH = (Path(__file__).resolve().parents[2] / "docs" / "physics.md").read_text()


@pytest.fixture(scope="module")
def runs() -> list[Run]:
    return [record(Bench(), (), family, 5, seconds=32.0) for family in ("steps", "open_loop")]


def _answers(runs: list[Run], active: tuple[Active, ...]) -> Array:
    """All signals of all runs, in units of their noise."""
    parts = []
    for run in runs:
        out = simulate(Bench(), run.inputs, 0.01, magnitudes(active))
        parts.append(np.stack([out[n] for n in SIGNALS], axis=1) / SCALE)
    return np.concatenate(parts)


@pytest.fixture(scope="module")
def nominal(runs: list[Run]) -> Array:
    return _answers(runs, ())


def _id(effect: Effect) -> str:
    """A test report must not tell a sealed effect to whoever works on the diagnosis."""
    if effect.kind == "sealed":
        return f"sealed-{names('sealed').index(effect.name) + 1}"
    return effect.name


@pytest.mark.parametrize("effect", EFFECTS, ids=_id)
def test_an_effect_acts_and_vanishes_at_zero(
    effect: Effect, runs: list[Run], nominal: Array
) -> None:
    def away(magnitude: float) -> float:
        off = _answers(runs, (Active(effect.name, magnitude),)) - nominal
        assert np.isfinite(off).all()
        return float(np.sqrt((off**2).mean(axis=0)).max())

    # All that the plant is told of effects: it computes the same.
    assert np.array_equal(magnitudes((Active(effect.name, 0.0),)), magnitudes())
    assert away(effect.usual * 1e-5) < 0.02
    assert away(effect.limit) > away(effect.usual) > 0.2


def test_the_lists_are_long_enough_and_apart() -> None:
    known, dev, sealed, spent = names("known"), names("dev"), names("sealed"), names("spent")
    assert len(known) >= 20
    assert len(dev) >= 118
    assert len(sealed) >= 16
    assert len(spent) >= 15
    assert len({*known, *dev, *sealed, *spent}) == len(EFFECTS)
    assert not DROPPED & {e.name for e in EFFECTS}
    assert {e.subsystem for e in EFFECTS} == {
        "electrical", "sensors", "thermal", "phase", "mechanics"
    }  # fmt: skip
    of_sealed = [e.subsystem for e in EFFECTS if e.kind == "sealed"]
    assert min(of_sealed.count(e.subsystem) for e in EFFECTS) >= 2


def test_an_effect_may_be_weaker_on_spring_y() -> None:
    table = magnitudes((Active("rtd_lag", 2.0, y_share=0.5, shape=0.25),))
    assert table.max(axis=1).tolist() == [2.0, 1.0, 0.5]


def test_an_effect_tells_where_the_model_can_hold_it_and_on_what_it_depends() -> None:
    tables = TRUTH.split("<!-- table: ")
    places = set(
        re.findall(r"^\| `(\w+)` \|", next(t for t in tables if t.startswith("places")), re.M)
    )
    listed = next(t for t in tables if t.startswith("states")).split("<!--")[0]
    states = {"constant", *re.findall(r"`(\w+)`", listed)}
    assert len(places) > 15
    for effect in EFFECTS:
        assert effect.places, effect.name
        assert set(effect.places) <= places, effect.name
        assert effect.states, effect.name
        assert set(effect.states) <= states, effect.name
    assert {p for d in own_differences() for p in d["places"]} <= places


def test_an_effect_of_one_spring_is_on_the_side_it_acts_on() -> None:
    assert Active("rtd_lag", 1.0).side == "both"
    assert Active("rtd_lag", 1.0, y_share=0.0).side == "x"
    assert Active("rtd_lag", 1.0, x_share=0.0).side == "y"
    assert Active("valve_leak", 1.0, y_share=0.0).side == "y"
    assert Active("force_gain", 1.0, y_share=0.0).side == "both"
    alone = next(e.name for e in EFFECTS if e.side == "one")
    assert Active(alone, 1.0, y_share=0.0).side == "x"
    assert Active(alone, 1.0, x_share=0.0).side == "y"
