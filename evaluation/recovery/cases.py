"""Which cases the recovery bank has.

Each effect of the library acts alone: at its typical strength and at a third of it, in a bench with
the nominal parameters and in one whose parameters have moved by half a prior deviation, on both
springs and, where it can, on X alone. Beside these are pairs, benches without any effect, and
benches of which the parameters alone have moved. Everything is drawn from one number.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Final, Literal

import msgspec
import numpy as np

from smad.diagnosis.plant import Effect
from smad.diagnosis.spring_pair import SmaPlant
from smad.diagnosis.verdict import CHANGED, CHECK_UP, DIFFERS

QUESTIONS = (DIFFERS, CHANGED, CHECK_UP)
SINGLE: Final = "single"
PAIR: Final = "pair"
NONE: Final = "none"
PARAMETERS: Final = "parameters"
THIRD = 1.0 / 3.0
PAIRS = 20
WITHOUT = 24
"""Benches without an effect, and as many with other parameters: each is a share of 4 %."""
MOVED_SD = 0.5
_Y_SHARE = "y_share"
_BENCHES = 2
"""Benches with moved parameters that check-ups share, since each needs a baseline."""

Theta = dict[str, float]


class Case(msgspec.Struct, frozen=True, kw_only=True):
    """One case. `bench` is the number of the bench that is drawn, 0 for the nominal one.

    `effects` are the values of the parameters of each effect, `strength` is their share of the
    typical one, `side` the spring that they act on.
    """

    name: str
    question: str
    kind: Literal["single", "pair", "none", "parameters"]
    seed: int
    bench: int = 0
    effects: dict[str, dict[str, float]] = {}
    strength: float = 0.0
    side: Literal["x", "both"] = "both"


def cases_of(
    plant: SmaPlant, questions: Sequence[str], seed: int, count: int | None = None
) -> list[Case]:
    """The cases of some questions, or the first `count` of each.

    Kinds take turns in proportion to their numbers, so that the first cases are a sample of all.
    """
    return [case for q in questions for case in _mixed(list(_all(plant, q, seed)), q, seed)[:count]]


def bench_parameters(plant: SmaPlant, case: Case, seed: int) -> tuple[Theta, Theta]:
    """The parameters of the bench when it was good, and those that it has now.

    Of *differs* only the second are asked for. What cannot be simulated, as a zero of a reading
    after mounting, stays.
    """
    nominal = {q.name: q.nominal for q in plant.parameters}
    good = nominal if case.bench == 0 else _moved(plant, nominal, [seed, 1, case.bench])
    changed = case.kind == PARAMETERS and case.question != DIFFERS
    return good, _moved(plant, good, [seed, 2, case.seed]) if changed else good


def _moved(plant: SmaPlant, theta: Theta, seed: Sequence[int]) -> Theta:
    """Each parameter of the simulator half a prior deviation up or down, within its range."""
    rng = np.random.default_rng(seed)
    names = set(plant.parameter_set.names)
    return theta | {
        q.name: float(np.clip(theta[q.name] + sign * MOVED_SD * q.prior_sd, q.low, q.high))
        for q in plant.parameters
        if q.name in names
        for sign in (rng.choice((-1.0, 1.0)),)
    }


def _all(plant: SmaPlant, question: str, seed: int) -> Iterator[Case]:
    """Every case of a question."""
    effects = [e for e in plant.effects if e.parameters]
    drawn: list[tuple[str, Case]] = []

    def add(words: str, moved: bool, **more: object) -> None:
        number = len(drawn) % _BENCHES if question == CHECK_UP else len(drawn)
        name = f"{question}-{words}{'-moved' if moved else ''}"
        own_seed = int(np.random.default_rng([seed, 0, *name.encode()]).integers(2**31))
        values = {"name": name, "question": question, "seed": own_seed}
        drawn.append(
            (name, msgspec.convert({**values, "bench": 1 + number if moved else 0, **more}, Case))
        )

    for moved in (False, True):
        for effect in effects:
            for strength, word in _strengths(effect):
                for side in _sides(effect):
                    words = f"{effect.name}{word}{'-x' if side == 'x' else ''}"
                    values = {effect.name: _values(effect, strength, side)}
                    add(words, moved, kind=SINGLE, effects=values, strength=strength, side=side)
    for k, two in enumerate(_pairs(effects, seed)):
        values = {e.name: _values(e, 1.0, "both") for e in two}
        words = "+".join(e.name for e in two)
        add(words, k % 2 == 1, kind=PAIR, effects=values, strength=1.0)
    for k in range(WITHOUT):
        # Moved parameters differ from the simulator; since good runs they are nothing new.
        add(f"none-{k}", question != DIFFERS and k % 2 == 1, kind=NONE)
        add(f"parameters-{k}", question == DIFFERS or k % 2 == 1, kind=PARAMETERS)
    return (case for _, case in drawn)


def _strengths(effect: Effect) -> list[tuple[float, str]]:
    """Shares of the typical strength with their words; an effect of a shape alone has one."""
    weaker = [(THIRD, "-third")] if any(q.strength for q in effect.parameters) else []
    return [(1.0, ""), *weaker]


def _sides(effect: Effect) -> tuple[str, ...]:
    return ("both", "x") if any(q.name == _Y_SHARE for q in effect.parameters) else ("both",)


def _values(effect: Effect, strength: float, side: str) -> dict[str, float]:
    values = {q.name: q.typical * (strength if q.strength else 1.0) for q in effect.parameters}
    return values | ({_Y_SHARE: 0.0} if side == "x" else {})


def _pairs(effects: Sequence[Effect], seed: int) -> list[tuple[Effect, Effect]]:
    """Pairs of effects that act at different places."""
    rng = np.random.default_rng([seed, 3])
    pairs: list[tuple[Effect, Effect]] = []
    while len(pairs) < PAIRS:
        a, b = sorted(rng.choice(len(effects), size=2, replace=False))
        first, other = effects[int(a)], effects[int(b)]
        if (first, other) not in pairs and not set(first.places) & set(other.places):
            pairs.append((first, other))
    return pairs


def _mixed(cases: Sequence[Case], question: str, seed: int) -> list[Case]:
    """The cases in an order of which every beginning has all kinds in proportion."""
    rng = np.random.default_rng([seed, 4, *question.encode()])
    turn: dict[str, float] = {}
    for kind in (SINGLE, PAIR, NONE, PARAMETERS):
        names = [c.name for c in cases if c.kind == kind]
        turn |= {n: (k + 0.5) / len(names) for k, n in enumerate(rng.permutation(names))}
    return sorted(cases, key=lambda c: (turn[c.name], c.name))
