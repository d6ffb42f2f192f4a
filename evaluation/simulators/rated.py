"""Ratings against what is then found: causes at three floors, and such as cannot be seen at all."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from evaluation.simulators.plants import SAMPLES, RatedPlant
from smad.diagnosis.plant import Array, Effect, ModelPoint
from smad.diagnosis.runs import GapRun
from smad.progress import Say
from smad.simulators import diagnose, plan
from smad.simulators.bind import bind
from smad.simulators.rating import IDENTIFIABLE, NOT, Rating

FLOORS = 3.0
_RUNS = 4


@dataclass(frozen=True, kw_only=True)
class Case:
    """A cause that was rated and then simulated; `named`: its place came first."""

    effect: str
    rating: str
    size: float
    seed: int
    named: bool
    first: str


def cases(plant: RatedPlant, count: int, seed: int, say: Say) -> Iterator[Case]:
    """`count` cases in all, identifiable ones first by turns, each on inputs of its own."""
    number = 0
    for k in range(count):
        played = [plant.inputs(1000 * (seed + k) + r) for r in range(_RUNS)]
        ratings = plan(played, plant.declared()).ratings
        rating = IDENTIFIABLE if k % 4 else NOT
        entries = [r for r in ratings if r.kind == "effect" and r.rating == rating]
        if not entries:
            continue
        chosen = entries[(k // 4 if rating == NOT else k) % len(entries)]
        case = _case(plant, chosen, played, seed=seed + k)
        number += 1
        say(f"{number}: {case}")
        yield case


def _case(plant: RatedPlant, rating: Rating, played: Sequence[dict[str, Array]], seed: int) -> Case:
    of = plant.declared()
    tables = [{**p, **{n: np.zeros(SAMPLES) for n in plant.readings}} for p in played]
    bound = bind(of, tables)
    effect, value = _effect(bound.plant.effects, rating.name)
    q = next(p for p in effect.parameters if p.name == value)
    size = min(FLOORS * rating.size, q.high) if rating.rating == IDENTIFIABLE else q.high
    point = ModelPoint(dict(plant.bench), {effect.name: {value: size}})
    rng = np.random.default_rng([seed, 7])
    runs = [_measured(plant, bound.plant.simulate(point, r), r, rng) for r in bound.groups[0]]
    causes = diagnose(runs, of).verdict.causes
    first = causes[0].place if causes else ""
    return Case(
        effect=rating.name,
        rating=rating.rating,
        size=size,
        seed=seed,
        first=first,
        named=first in effect.places,
    )


def _measured(
    plant: RatedPlant, outputs: Mapping[str, Array], run: GapRun, rng: np.random.Generator
) -> GapRun:
    read = {}
    for name, y in outputs.items():
        noise, decimals = plant.readings[name]
        read[name] = np.round(y + noise * rng.standard_normal(len(y)), decimals)
    return replace(run, outputs=read)


def _effect(effects: Sequence[Effect], name: str) -> tuple[Effect, str]:
    for e in effects:
        for q in e.parameters:
            if name in (e.name, f"{e.name}.{q.name}") and q.strength:
                return e, q.name
    raise ValueError(f"no effect {name}")


def shares(tried: Sequence[Case]) -> list[str]:
    """What was found of each rating, in words."""
    out = []
    for rating in (IDENTIFIABLE, NOT):
        part = [c for c in tried if c.rating == rating]
        hit = sum(c.named for c in part)
        if part:
            out.append(f"{rating}: place first in {hit} of {len(part)}, {hit / len(part):.2f}")
    return out
