"""What goes wrong in a night, and when: drawn from a seed. Pure."""

from __future__ import annotations

import random
from collections.abc import Mapping
from typing import NamedTuple

TROUBLES: Mapping[str, str] = {
    "unplug": "the cable is out for some seconds",
    "reboot": "the board restarts",
    "stop": "somebody else disarms",
    "estop": "somebody else presses the emergency stop; the board is power-cycled",
    "kill item": "the process of the item is killed",
    "kill runner": "the runner of the queue is killed",
    "kill daemon": "the daemon is killed, and the board restarts",
    "power loss": "runner, item and daemon are killed at once, and the board restarts",
    "kill hooks": "the hooks are killed",
}
"""What goes wrong -> in words."""
ENDS_NOTHING = "kill hooks"
"""This one ends no item; one that ends afterwards was ended by something else."""


class Trouble(NamedTuple):
    """One trouble, so many seconds of board time after the night began."""

    at_s: float
    kind: str


def troubles(seed: int, seconds: float, count: int) -> list[Trouble]:
    """Return `count` troubles within `seconds` of board time, in their order.

    Each kind comes before any comes again; the first tenth and the last are left in peace.
    """
    draw = random.Random(f"night {seed}")
    kinds: list[str] = []
    while len(kinds) < count:
        turn = list(TROUBLES)
        draw.shuffle(turn)
        kinds += turn
    times = sorted(draw.uniform(0.1 * seconds, 0.9 * seconds) for _ in range(count))
    return [Trouble(at_s, kind) for at_s, kind in zip(times, kinds, strict=False)]
