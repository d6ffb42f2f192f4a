"""What a night showed, as tables, and what a week would take by its slopes. Pure."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from campaign.night.draws import Trouble
from smad.report.page import Table

MESSAGE_S = 5.0
"""So long after a trouble that ended something its word must be there, by the wall clock."""
WEEK_H = 7 * 24.0
_LEAST_POINTS = 8
WARMING_H = 0.25
"""So long a process fills its buffers: the black box, the first run logs."""


class Look(NamedTuple):
    """What was there at a moment of board time (h): `process` tells one that was started anew."""

    at_h: float
    process: int
    amount: float


@dataclass
class Met:
    """One trouble as it came: what it was, the word that followed and after how long."""

    at_s: float
    kind: str
    item: int
    during: str
    word: str = ""
    after_s: float | None = None
    paused: bool = False


@dataclass
class NightResult:
    """What a night gave. `looks` are by what was looked at, in MB."""

    seed: int
    board_h: float = 0.0
    wall_h: float = 0.0
    met: list[Met] = field(default_factory=list)
    states: Counter[str] = field(default_factory=Counter)
    visits: int = 0
    messages: int = 0
    cycles: int = 0
    failures: list[str] = field(default_factory=list)
    looks: dict[str, list[Look]] = field(default_factory=dict)


def late(night: NightResult) -> list[str]:
    """Return the troubles that paused the queue and whose word did not come in time."""
    return [
        f"{met.kind} at {met.at_s:.0f} s: "
        + ("no word" if met.after_s is None else f"word after {met.after_s:.1f} s")
        for met in night.met
        if met.paused and (met.after_s is None or met.after_s > MESSAGE_S)
    ]


def unmet(board_s: float, seconds: float, due: Sequence[Trouble]) -> list[str]:
    """Return what a night lacks that was to last so many seconds: time, and the troubles left."""
    lacks = [f"{trouble.kind} at {trouble.at_s:.0f} s met no item" for trouble in due]
    if board_s < seconds:
        lacks.insert(0, f"the queue held no more items after {board_s:.0f} s of {seconds:.0f} s")
    return lacks


def troubles_table(night: NightResult) -> Table:
    """Return a row for each trouble."""
    rows = [
        (
            f"{met.at_s / 3600.0:.2f}",
            met.kind,
            met.during,
            "paused" if met.paused else "went on",
            "" if met.after_s is None else f"{met.after_s:.1f}",
            met.word,
        )
        for met in night.met
    ]
    header = ("board h", "trouble", "during", "queue", "word after s", "word")
    return Table(header, rows, numeric=frozenset({0, 4}))


class Slope(NamedTuple):
    """The last amount (MB), its growth (MB an hour of board time), over how many hours it is."""

    amount: float
    per_h: float
    hours: float


def slope_of(looks: Sequence[Look]) -> Slope | None:
    """Return the slope over the longest life of one process, without its first quarter of an hour.

    None when less than eight looks are left.
    """
    lives: dict[int, list[Look]] = {}
    for look in looks:
        lives.setdefault(look.process, []).append(look)
    longest = max(lives.values(), key=lambda life: life[-1].at_h - life[0].at_h, default=[])
    life = [look for look in longest if look.at_h >= longest[0].at_h + WARMING_H]
    if len(life) < _LEAST_POINTS:
        return None
    at_h, amount = np.array([(look.at_h, look.amount) for look in life]).T
    return Slope(float(amount[-1]), float(np.polyfit(at_h, amount, 1)[0]), float(np.ptp(at_h)))


def week_table(night: NightResult) -> Table:
    """Return what each amount comes to in a week at its slope."""
    rows = []
    for name, looks in night.looks.items():
        slope = slope_of(looks)
        if slope is None:
            rows.append((name, f"{looks[-1].amount:.1f}" if looks else "", "too short", "", ""))
            continue
        rows.append(
            (
                name,
                f"{slope.amount:.1f}",
                f"{slope.per_h:+.3f}",
                f"{slope.hours:.2f}",
                f"{slope.amount + slope.per_h * WEEK_H:.0f}",
            )
        )
    header = ("MB", "now", "an hour more", "over h", "after a week")
    return Table(header, rows, numeric=frozenset({1, 2, 3, 4}))


def facts(night: NightResult) -> str:
    """Return the night in a line."""
    speed = night.board_h / night.wall_h if night.wall_h else 0.0
    states = ", ".join(f"{count} {state}" for state, count in sorted(night.states.items()))
    return (
        f"seed {night.seed}: {night.board_h:.2f} h of board time in {night.wall_h:.2f} h "
        f"({speed:.1f} times real time); items: {states}; {night.cycles} endurance cycles; "
        f"{len(night.met)} troubles, {night.visits} visits of a person, {night.messages} messages"
    )


def rerun(begun: str, ids: Sequence[int]) -> Mapping[int, int]:
    """Return the items that the runners' log says began more than once, with how often."""
    counts = {number: begun.count(f"item {number} begins:") for number in ids}
    return {number: count for number, count in counts.items() if count > 1}
