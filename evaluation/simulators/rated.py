"""Ratings against what is then found: causes at three floors, and such as cannot be seen at all."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.signal import lfilter

from smad.diagnosis.plant import Array, Effect, ModelPoint
from smad.diagnosis.runs import GapRun
from smad.simulators import Missing, Simulator, diagnose, plan, simulator
from smad.simulators.bind import bind
from smad.simulators.rating import IDENTIFIABLE, NOT, Rating

FLOORS = 3.0
_RUNS = 4
_SAMPLES = 600
_DT_S = 0.1


@dataclass(frozen=True, kw_only=True)
class Case:
    """A cause that was rated and then simulated; `found`: its place came first."""

    effect: str
    rating: str
    size: float
    seed: int
    found: bool
    first: str


def heater(t: Array, inputs: Mapping[str, Array], values: Mapping[str, float], start: Any) -> Any:
    """A heated plate with a thermometer and a fan, linear up to what may be missing."""
    drive = inputs["power_W"] - values["leak_W_K2"] * np.maximum(inputs["power_W"] - 20.0, 0.0)
    # No inputs here reach so far.
    drive = drive - values["overload_W_W2"] * np.maximum(inputs["power_W"] - 60.0, 0.0)
    given = drive - values["fan_W"] * inputs["fan"]
    keep = 1.0 - _DT_S * values["loss_W_K"] / values["capacity_J_K"]
    above = lfilter([0.0, _DT_S / values["capacity_J_K"]], [1.0, -keep], given)
    return {"temperature_degC": values["room_degC"] + above}


def declared() -> Simulator:
    """The heater with transducers, its power with a bend and its fan with a strength."""
    at_power = ("input_power_W",)
    return simulator(
        heater,
        parameters={
            "capacity_J_K": (30.0, 20.0, 40.0, 3.0), "loss_W_K": (0.8, 0.5, 1.1, 0.1),
            "room_degC": (22.0, 17.0, 27.0, 1.0), "fan_W": (4.0, 1.0, 9.0, 2.0),
        },
        effects={
            "leak_W_K2": Missing(typical=0.1, low=-0.5, high=0.5, places=at_power),
            "overload_W_W2": Missing(typical=0.1, low=-0.5, high=0.5, places=at_power),
        },
        noise={"temperature_degC": 0.03}, transducers=True,
    )  # fmt: skip


def inputs(seed: int) -> dict[str, Array]:
    """Steps of power and of a fan."""
    rng = np.random.default_rng(seed)
    power = np.repeat(rng.uniform(0.0, 45.0, _SAMPLES // 50), 50)
    fan = np.repeat(rng.uniform(0.0, 1.0, _SAMPLES // 30), 30)
    power[:50] = fan[:50] = 0.0
    t_s = np.asarray(np.arange(_SAMPLES) * _DT_S, dtype=np.float64)
    return {"t_s": t_s, "power_W": power, "fan": fan}


def cases(count: int, seed: int, say: Callable[[str], None]) -> Iterator[Case]:
    """`count` cases in all, identifiable ones first by turns, each on inputs of its own."""
    made = 0
    for k in range(count):
        of = declared()
        played = [inputs(1000 * (seed + k) + r) for r in range(_RUNS)]
        ratings = plan(played, of).ratings
        wanted = IDENTIFIABLE if k % 4 else NOT
        entries = [r for r in ratings if r.kind == "effect" and r.rating == wanted]
        if not entries:
            continue
        chosen = entries[(k // 4 if wanted == NOT else k) % len(entries)]
        case = _asked(of, chosen, played, seed=seed + k)
        made += 1
        say(f"{made}: {case}")
        yield case


def _asked(of: Simulator, rating: Rating, played: Sequence[dict[str, Array]], seed: int) -> Case:
    tables = [{**p, "temperature_degC": np.zeros(_SAMPLES)} for p in played]
    bound = bind(of, tables)
    effect, value = _effect(bound.plant.effects, rating.name)
    q = next(p for p in effect.parameters if p.name == value)
    size = min(FLOORS * rating.size, q.high) if rating.rating == IDENTIFIABLE else q.high
    point = ModelPoint(
        {"capacity_J_K": 31.5, "loss_W_K": 0.77, "room_degC": 22.3, "fan_W": 4.3},
        {effect.name: {value: size}},
    )
    rng = np.random.default_rng([seed, 7])
    runs = [_measured(bound.plant.simulate(point, r), r, rng) for r in bound.groups[0]]
    causes = diagnose(runs, of).verdict.causes
    first = causes[0].place if causes else ""
    return Case(effect=rating.name, rating=rating.rating, size=size, seed=seed, first=first,
                found=first in effect.places)  # fmt: skip


def _measured(shown: Mapping[str, Array], run: GapRun, rng: np.random.Generator) -> GapRun:
    read = {
        n: np.round(y + 0.03 * rng.standard_normal(len(y)), 2) for n, y in shown.items()
    }  # fmt: skip
    return replace(run, outputs=read)


def _effect(effects: Sequence[Effect], name: str) -> tuple[Effect, str]:
    for e in effects:
        for q in e.parameters:
            if name in (e.name, f"{e.name}.{q.name}") and q.strength:
                return e, q.name
    raise ValueError(f"no effect {name}")


def shares(found: Sequence[Case]) -> list[str]:
    """What was found of each rating, in words."""
    out = []
    for rating in (IDENTIFIABLE, NOT):
        own = [c for c in found if c.rating == rating]
        hit = sum(c.found for c in own)
        if own:
            out.append(f"{rating}: place first in {hit} of {len(own)}, {hit / len(own):.2f}")
    return out
