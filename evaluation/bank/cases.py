"""Which cases a bank has: kinds, effects and seeds, all drawn from one number."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from evaluation.errors import BankError
from evaluation.plant.effects import BY_NAME, SIGNED, Active, names

KINDS = ("single", "unknown", "pair", "triple")
WITHOUT = ("none", "parameters", "room", "preload", "drift")
"""Kinds of cases with and without an effect; of *differs* every second case has one."""
DIFFERS = "differs"

ONE_SIDED = 0.25
"""Share of the effects of single springs that act on X alone, and as many on Y alone."""
CHOICES = 4

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
    kind: str
    choices: tuple[tuple[Active, ...], ...]
    seed: int

    @property
    def name(self) -> str:
        """Folder and key of the case."""
        return f"case-{self.number:03d}"


def _drawn(rng: np.random.Generator, name: str) -> Active:
    """One effect at its usual size, with sign, the springs' shares and its shape."""
    sign = -1.0 if name in SIGNED and rng.integers(2) else 1.0
    x_share, y_share, shape = 1.0, float(rng.uniform(0.6, 1.0)), float(rng.uniform())
    where = rng.uniform()
    alone = {"both": 0.0, "one": 0.5}.get(BY_NAME[name].side, ONE_SIDED)
    if where < 2 * alone:
        x_share, y_share = (1.0, 0.0) if where < alone else (0.0, 1.0)
    return Active(name, sign * BY_NAME[name].usual, y_share, shape, x_share)


def _spread(rng: np.random.Generator, pool: tuple[str, ...], count: int) -> list[str]:
    """`count` effects, every one about equally often. Raises BankError where there are none."""
    if count and not pool:
        raise BankError("there are no effects to draw from: write new ones (evaluation/README.md)")
    order: list[str] = []
    while len(order) < count:
        order += [str(n) for n in rng.permutation(pool)]
    return order[:count]


def _substitutes(
    rng: np.random.Generator, pool: tuple[str, ...], first: str
) -> tuple[tuple[Active, ...], ...]:
    others = rng.permutation([n for n in pool if n != first])[: CHOICES - 1]
    return tuple((_drawn(rng, str(n)),) for n in (first, *others))


def _together(rng: np.random.Generator, size: int) -> tuple[Active, ...]:
    pool = names("known")
    while True:
        chosen = [str(n) for n in rng.choice(pool, size=size, replace=False)]
        subsystems = {BY_NAME[n].subsystem for n in chosen}
        clash = any(pair <= set(chosen) for pair in APART)
        if len(subsystems) >= 2 and not clash:
            return tuple(_drawn(rng, n) for n in chosen)


def scaled(counts: Mapping[str, int], total: int) -> dict[str, int]:
    """The same mixture with about `total` cases, at least one of each kind that it has."""
    factor = total / sum(counts.values())
    return {kind: max(1, round(n * factor)) for kind, n in counts.items() if n and total}


def draw(seed: int, counts: Mapping[str, int], *, sealed: bool) -> list[Case]:
    """All cases of a bank in shuffled order; effects of no list are sealed ones or `dev`.

    Of `counts` each kind has so many; those of *differs* come last.
    """
    rng = np.random.default_rng((seed, 1))
    pools = {"single": names("known"), "unknown": names("sealed" if sealed else "dev")}
    drawn: list[tuple[str, tuple[tuple[Active, ...], ...]]] = []
    for kind, pool in pools.items():
        firsts = _spread(rng, pool, counts.get(kind, 0))
        drawn += [(kind, _substitutes(rng, pool, name)) for name in firsts]
    for kind, size in (("pair", 2), ("triple", 3)):
        for _ in range(counts.get(kind, 0)):
            drawn.append((kind, tuple(_together(rng, size) for _ in range(CHOICES))))
    drawn += [(kind, ((),)) for kind in WITHOUT for _ in range(counts.get(kind, 0))]
    drawn = [drawn[i] for i in rng.permutation(len(drawn))]
    of_differs = []
    for i in range(counts.get(DIFFERS, 0)):
        pool = pools["single" if i % 4 == 0 else "unknown"]
        with_effect = i % 2 == 0
        choices = _substitutes(rng, pool, str(rng.choice(pool))) if with_effect else ((),)
        of_differs.append((DIFFERS, choices))
    drawn += [of_differs[i] for i in rng.permutation(len(of_differs))]
    seeds = rng.integers(2**31, size=len(drawn))
    return [Case(n + 1, *entry, int(seeds[n])) for n, entry in enumerate(drawn)]
