"""Which cases a bank has: kinds, effects, strengths and seeds, all drawn from one number."""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from evaluation.bank.excitation import FOR_FITTING, FOR_HOLDING_OUT, RUN_s
from evaluation.bank.strength import Plan
from evaluation.plant.effects import BY_NAME, SIGNED, Active, names

Kind = Literal[
    "single", "none", "parameters", "unknown", "pair", "triple", "differs",
    "room", "preload", "drift",
]  # fmt: skip

STRENGTHS = (1.0, 3.0, 10.0)
DEFAULT = {"single": 60, "none": 15, "parameters": 15, "unknown": 36, "pair": 18, "triple": 6}
FULL = {"single": 186, "none": 45, "parameters": 45, "unknown": 100, "pair": 48, "triple": 16}
MINI = {"single": 1, "none": 1, "parameters": 1, "unknown": 1, "pair": 1, "triple": 0}

DIFFERS = 4

WITHOUT: tuple[Kind, ...] = ("none", "parameters", "room", "preload", "drift")
"""Kinds of cases without an effect."""

APART = {
    frozenset(("tube_friction", "viscous_drag")),
    frozenset(("tendon_compliance", "tube_stiffness")),
    frozenset(("encoder_slip", "encoder_backlash")),
    frozenset(("rtd_offset", "rtd_stem_error")),
    frozenset(("flow_shortfall", "pump_dead_time")),
}
"""Pairs that are not put together, as one can stand for the other by definition."""


@dataclass(frozen=True)
class Case:
    """One case before it is made. `choices` are tried in order until one reaches its strength."""

    number: int
    kind: Kind
    choices: tuple[tuple[Active, ...], ...]
    target: float
    seed: int

    @property
    def name(self) -> str:
        """Folder and key of the case."""
        return f"case-{self.number:03d}"


def _drawn(rng: np.random.Generator, name: str) -> Active:
    """One effect, magnitude left open (0 but signed), with spring Y's share and its shape."""
    sign = -1.0 if name in SIGNED and rng.integers(2) else 1.0
    share, shape = float(rng.uniform(0.6, 1.0)), float(rng.uniform())
    return Active(name, sign * BY_NAME[name].usual, share, shape)


def _spread(rng: np.random.Generator, pool: tuple[str, ...], count: int) -> list[tuple[str, float]]:
    """`count` (effect, strength) with every strength and every effect about equally often."""
    out: list[tuple[str, float]] = []
    for i, strength in enumerate(STRENGTHS):
        wanted = count // 3 + (1 if i < count % 3 else 0)
        order: list[str] = []
        while len(order) < wanted:
            order += [str(n) for n in rng.permutation(pool)]
        out += [(name, strength) for name in order[:wanted]]
    return out


def _substitutes(
    rng: np.random.Generator, pool: tuple[str, ...], first: str
) -> tuple[tuple[Active, ...], ...]:
    others = [str(n) for n in rng.permutation([n for n in pool if n != first])[:3]]
    return tuple((_drawn(rng, n),) for n in (first, *others))


def _together(rng: np.random.Generator, size: int) -> tuple[Active, ...]:
    known = names("known")
    while True:
        chosen = [str(n) for n in rng.choice(known, size=size, replace=False)]
        subsystems = {BY_NAME[n].subsystem for n in chosen}
        clash = any(pair <= set(chosen) for pair in APART)
        if len(subsystems) >= 2 and not clash:
            return tuple(_drawn(rng, n) for n in chosen)


def scaled(counts: dict[str, int], total: int) -> dict[str, int]:
    """The same mixture with about `total` cases, at least one of each kind that it has."""
    factor = total / sum(counts.values())
    return {kind: max(1, round(n * factor)) if n else 0 for kind, n in counts.items()}


def draw(bank: str, seed: int, counts: dict[str, int], differs: int) -> list[Case]:
    """All cases of a bank in shuffled order; `bank` decides which unknown effects it may hold."""
    rng = np.random.default_rng((seed, 1))
    counts = {"single": 0, "unknown": 0, "pair": 0, "triple": 0, **counts}
    unknown = names("sealed" if bank == "sealed" else "dev")
    known = names("known")
    drawn: list[tuple[Kind, tuple[tuple[Active, ...], ...], float]] = []
    for name, strength in _spread(rng, known, counts["single"]):
        drawn.append(("single", _substitutes(rng, known, name), strength))
    for name, strength in _spread(rng, unknown, counts["unknown"]):
        drawn.append(("unknown", _substitutes(rng, unknown, name), strength))
    several: tuple[tuple[Kind, int], ...] = (("pair", 2), ("triple", 3))
    for kind, size in several:
        for i in range(counts[kind]):
            choices = tuple(_together(rng, size) for _ in range(4))
            drawn.append((kind, choices, (3.0, 10.0)[i % 2]))
    for kind in WITHOUT:
        drawn += [(kind, ((),), 0.0)] * counts.get(kind, 0)
    for name in (str(n) for n in rng.permutation(np.resize(known, differs))):
        drawn.append(("differs", _substitutes(rng, known, name), STRENGTHS[-1]))
    order = rng.permutation(len(drawn))
    seeds = rng.integers(2**31, size=len(drawn))
    return [
        Case(n + 1, drawn[i][0], drawn[i][1], drawn[i][2], int(seeds[n]))
        for n, i in enumerate(order)
    ]


def drawn_differs(bank: str, seed: int, count: int, first: int) -> list[Case]:
    """Cases of *differs*: every second one has an effect, listed and unlisted ones in turn."""
    rng = np.random.default_rng((seed, 4))
    pools = (names("known"), names("sealed" if bank == "sealed" else "dev"))
    choices: list[tuple[tuple[Active, ...], ...]] = [((),)] * count
    for i in range(0, count, 2):
        pool = pools[i // 2 % 2]
        choices[i] = _substitutes(rng, pool, str(rng.choice(pool)))
    order = rng.permutation(count)
    seeds = rng.integers(2**31, size=count)
    return [
        Case(first + n, "differs", choices[i], 0.0, int(seeds[n])) for n, i in enumerate(order)
    ]


def plan(rng: np.random.Generator, seconds: float = RUN_s) -> Plan:
    """Four runs to fit and two held out, of other families, in shuffled order."""
    fit = ["open_loop", *rng.choice([f for f in FOR_FITTING if f != "open_loop"], 3, replace=False)]
    held_out = rng.choice(FOR_HOLDING_OUT, 2, replace=False)
    runs = [(str(f), "fit") for f in fit] + [(str(f), "hold_out") for f in held_out]
    seeds = rng.integers(2**31, size=len(runs))
    return Plan(
        tuple((runs[i][0], int(seeds[i]), runs[i][1]) for i in rng.permutation(len(runs))),
        seconds,
    )


def commissioning(rng: np.random.Generator) -> list[tuple[str, int]]:
    """Families and seeds of three known-good runs, among them one of the held-out families."""
    kinds = [
        str(rng.choice(("steps", "staircase", "air"))),
        str(rng.choice(("open_loop", "slow_heat"))),
        str(rng.choice(FOR_HOLDING_OUT)),
    ]
    return [(kind, int(rng.integers(2**31))) for kind in kinds]
