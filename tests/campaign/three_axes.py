"""Every injection on one of three axes, of all of which the same is asked.

`python -m tests.campaign.three_axes [ROW…]`. The daemon is the real one, with three boards on
virtual time (`tests.smad.daemon.rig`). Faults of the host are left out: they are of the whole
bench, and `python -m campaign faults` has them.
"""

from __future__ import annotations

import asyncio
import math
import random
import statistics
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import msgspec

from campaign.faults.catalogue import ROWS, Row
from campaign.faults.lockstep import TIGHTENED_UNHEATED_mJ, gate_open_after
from campaign.faults.oracle import Then
from campaign.faults.scenes import SCENES, Scene
from campaign.faults.trace import HOT, WatchedBench
from campaign.virtual import Line
from smad.api import BY_PARAMS
from tests.smad.daemon.axes import NAMES, PHASE_US, axes_in
from tests.smad.daemon.rig import Rig

VICTIM = "yaw-1"
OTHERS_SAFE_S = 0.2
"""After the board with the fault is off, the others have so long to be off as well."""
AFTER_SAFE_J = 0.2
OFF = (Then.STOPS, Then.RESTARTS, Then.DISARMS, Then.ENDS_OFF)


@dataclass(frozen=True)
class Found:
    """What came of an injection: how long after the victim the others were off (s), and wrongs."""

    row: str
    scene: str
    stopped: bool
    others_after_s: float
    wrongs: tuple[str, ...]


def rows() -> list[Row]:
    """The rows of the campaign that break a board, its parts or its line."""
    return [row for row in ROWS.values() if row.kind.group != "host"]


async def run_case(row: Row, seed: int) -> Found:
    """Inject a fault into one of three axes that all do the same, and judge all of them."""
    rng = random.Random(f"{seed} {row.name}")
    scene = SCENES[rng.choice(sorted(row.scenes & (row.must or row.scenes) or row.scenes))]
    boards = {
        name: Line(WatchedBench(seed=k, cooling=scene.cooling, axis_name=name), k * PHASE_US)
        for k, name in enumerate(NAMES)
    }
    line = boards[VICTIM]
    with tempfile.TemporaryDirectory() as folder:
        async with axes_in(Path(folder), boards) as rig:
            await rig.run_for(2.5)
            if row.tightened:
                supervisor = line.bench.board.supervisor
                energy_mJ = TIGHTENED_UNHEATED_mJ["A"]
                supervisor.set_limits(replace(supervisor.limits, unheated_energy_mJ=energy_mJ))
            await rig.ask("arm")
            return await _injected(rig, row, scene, rng)


async def _injected(rig: Rig, row: Row, scene: Scene, rng: random.Random) -> Found:
    boards = {name: line.bench for name, line in rig.lines.items()}
    start_us = boards[VICTIM].now_us
    onset_s = rng.uniform(*(row.onset_s or scene.onset_s))
    one = row.drawn(rng, start_us + round(onset_s * 1e6))
    boards[VICTIM].faults.add(one)
    lasts_s = one.lasts_s if math.isfinite(one.lasts_s) else one.parameters.get("seconds", 0.0)
    end_us = start_us + round((onset_s + lasts_s + row.observe_s) * 1e6)
    waiting = list(scene.script)
    seen_off = False
    while boards[VICTIM].now_us < end_us:
        passed_s = (boards[VICTIM].now_us - start_us) * 1e-6
        if waiting and passed_s >= waiting[0][0]:
            await _command(rig, waiting.pop(0)[1])
        await rig.run(3)
        off = boards[VICTIM].board.state not in HOT and boards[VICTIM].now_us > one.at_us
        if off and not seen_off:
            seen_off = True
            end_us = min(end_us, boards[VICTIM].now_us + round((2.0 + lasts_s) * 1e6))
    return _judged(row, scene, {n: b for n, b in boards.items() if isinstance(b, WatchedBench)})


async def _command(rig: Rig, command: msgspec.Struct) -> None:
    params = msgspec.to_builtins(command)
    params.pop("mode", None)
    for name in rig.lines:
        reply = rig.begin(BY_PARAMS[type(command)].name, members={"axis": name}, **params)
        await rig.run_until(reply)


def _judged(row: Row, scene: Scene, boards: dict[str, WatchedBench]) -> Found:
    onset_us = boards[VICTIM].faults.begun[0][0]
    safe_us = {name: bench.trace.safe_at(onset_us) for name, bench in boards.items()}
    own_us = safe_us[VICTIM]
    wrongs = []
    then = row.then_in(scene.name)
    if then in OFF and own_us is None:
        wrongs.append("the board with the fault did not stop")
    others_s = []
    for name, bench in boards.items():
        at_us = safe_us[name]
        latched = bench.board.supervisor.first_fault
        if (at_us is None) != (own_us is None):
            wrongs.append(f"{name} is {'armed' if at_us is None else 'off'}, {VICTIM} is not")
        if name != VICTIM and latched is not None:
            wrongs.append(f"{name} latched {latched.fault.name}")
        if at_us is None or own_us is None:
            continue
        if name != VICTIM:
            others_s.append((at_us - own_us) * 1e-6)
        if gate_open_after(bench.trace, at_us):
            wrongs.append(f"the gate of {name} opened again")
        late_J = bench.trace.heat_J[-1] - bench.trace.heat_at(at_us)
        if late_J > AFTER_SAFE_J:
            wrongs.append(f"{late_J:.2f} J went into {name} after it was off")
    after_s = max(others_s, default=math.nan)
    if after_s > OTHERS_SAFE_S:
        wrongs.append(f"the others were off {after_s:.2f} s later")
    first = boards[VICTIM].board.supervisor.first_fault
    if then is Then.STOPS and first is not None and first.fault.name not in row.faults:
        wrongs.append(f"the first fault is {first.fault.name}")
    if then is Then.GOES_ON and own_us is not None:
        wrongs.append("it stopped for what is harmless")
    return Found(row.name, scene.name, own_us is not None, after_s, tuple(wrongs))


def main(arguments: Sequence[str]) -> int:
    """Run every row, or those named; return 1 when anything is wrong."""
    chosen = [row for row in rows() if not arguments or row.name in arguments]
    found = []
    for row in chosen:
        found.append(asyncio.run(run_case(row, 1)))
        one = found[-1]
        told = "; ".join(one.wrongs) or "good"
        print(
            f"{one.row:<28} {one.scene:<9} {'stopped' if one.stopped else 'went on':<8} {told}",
            flush=True,
        )
    stopped = [one.others_after_s for one in found if one.stopped]
    if stopped:
        print(
            f"{len(found)} injections on {VICTIM}, {len(stopped)} stopped all three axes; the "
            f"others off after it by p50 {1e3 * statistics.median(stopped):.0f} ms, "
            f"at most {1e3 * max(stopped):.0f} ms"
        )
    wrong = sum(bool(one.wrongs) for one in found)
    print(f"{wrong} wrong")
    return 1 if wrong else 0


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
