"""Which cases a campaign runs: every row in turn, and pairs drawn from the seed, on every core."""

from __future__ import annotations

import itertools
import os
import random
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context

from campaign.faults.catalogue import ROWS, Row
from campaign.faults.lockstep import Case, drawn_case, run_case
from campaign.faults.oracle import Outcome
from firmware_protocol.nearest import instead
from smad.errors import CommandError

_CASES_A_TASK = 4
_NICENESS = 5


def chosen_rows(only: Sequence[str]) -> tuple[Row, ...]:
    """The rows of these names, or of these rows of the device's table; all if none is named.

    Raises CommandError for a name that does not exist.
    """
    if not only:
        return tuple(ROWS.values())
    selected: dict[str, Row] = {}
    known = {name_or_kind for row in ROWS.values() for name_or_kind in (row.name, row.kind.name)}
    for name in only:
        rows = [row for row in ROWS.values() if name in (row.name, row.kind.name)]
        if not rows:
            raise CommandError(
                "no fault of the campaign has this name",
                value=name,
                action=instead(name, known, "docs/guide/fault-campaign.md lists them"),
            )
        selected.update({row.name: row for row in rows})
    return tuple(selected.values())


def single_cases(seed: int, count: int, rows: Sequence[Row]) -> list[Case]:
    """`count` cases, the rows taking turns."""
    turns = itertools.islice(itertools.cycle(rows), count)
    return [drawn_case(seed, number, (row,)) for number, row in enumerate(turns)]


def pair_cases(seed: int, count: int) -> list[Case]:
    """`count` cases of two faults within two seconds, of different parts."""
    rng = random.Random(f"{seed} pairs")
    cases: list[Case] = []
    # A row with a time of its own could not be the second.
    rows = [row for row in ROWS.values() if row.onset_s is None]
    while len(cases) < count:
        first, second = rng.sample(rows, 2)
        # Two faults of one part overwrite each other: that is one fault, under a wrong name.
        if _part(first) != _part(second):
            cases.append(drawn_case(seed, len(cases), (first, second)))
    return cases


def _part(row: Row) -> str:
    name = row.kind.name.split("_")[0]
    if name in ("driver", "wire"):
        return "driver"
    if row.kind.group == "sensor" and name in ("sensor", "sensors"):
        return "rtd"
    if name in ("stall", "lost", "unplug", "delay", "wrong"):
        return "line"
    return name if row.kind.group in ("actuator", "sensor") else row.kind.name


def outcomes(cases: Sequence[Case], jobs: int | None = None) -> Iterator[Outcome]:
    """What came of each case, in their order, run on `jobs` processes (None: one a core)."""
    workers = min(jobs or os.cpu_count() or 1, len(cases))
    if workers <= 1:
        yield from map(run_case, cases)
        return
    # Not forked: the parent may have threads, and the compiled physics is cached on disk anyway.
    with ProcessPoolExecutor(
        workers, mp_context=get_context("spawn"), initializer=os.nice, initargs=(_NICENESS,)
    ) as pool:
        yield from pool.map(run_case, cases, chunksize=_CASES_A_TASK)
