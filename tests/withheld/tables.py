"""Score tables of a development bank, with what the rule in force says, one file a case.

They take minutes of processor time a case; judging them under other constants takes none.
"""

import json
import time
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from smad.gap.check.bank import open_bank, read_case
from smad.gap.check.case import How
from smad.gap.compare.tracks import follow_tracks
from smad.gap.compare.verdict import decide
from smad.gap.compare.weigh import weigh
from smad.gap.diagnose import ready
from tests.withheld.engine.table import Kind, Row, ScoreTable
from tests.withheld.engine.tabulate import tabulate
from tests.withheld.errors import BankError


def make(bank: Path, out: Path, *, cases: Sequence[str] = (), compare: bool = True) -> None:
    """A table of each case that has none yet in `out`.

    With `compare` also the verdict of the rule in force, for which the same runs are fitted again.
    """
    opened = open_bank(bank)
    if "sealed" in opened.manifest.bank:
        raise BankError(f"{bank} is sealed: constants come from development banks")
    out.mkdir(parents=True, exist_ok=True)
    for case in opened.manifest.cases:
        path = out / f"{case.id}.npz"
        if path.exists() or (cases and case.id not in cases):
            continue
        how, runs = How(), read_case(opened, case)
        plant, settings = how.plant(), how.settings_used()
        times = [time.process_time()]
        with ThreadPoolExecutor(max_workers=1) as one:
            prepared = ready(
                runs.fit, plant=plant, good=runs.good, hold_out=runs.hold_out,
                settings=settings, executor=one,
            )  # fmt: skip
            times.append(time.process_time())
            table = tabulate(prepared, plant.effects, settings.form_share)
            times.append(time.process_time())
            told: dict[str, Any] = {"case": case.id, "question": case.question}
            told["seconds"] = {"prepare": times[1] - times[0], "table": times[2] - times[1]}
            if compare:
                numbers = weigh(prepared, follow_tracks(prepared, plant.effects))
                outcome, p = decide(numbers, settings)
                told["seconds"]["before"] = time.process_time() - times[2]
                told["before"] = {"outcome": outcome.value, "effects": numbers.effects, "p": p}
                first = numbers.effects[0] if numbers.effects else ""
                told["before"]["group"] = list(numbers.groups.get(first, ()))
        write(path, table, told)
        print(case.id, json.dumps(told), flush=True)


def write(path: Path, table: ScoreTable, told: dict[str, Any]) -> None:
    """Keeps a table and what is told of its case."""
    rows = [
        {"kind": r.kind.value, "names": r.names, "parent": r.parent, "moved": r.moved}
        for r in table.rows
    ]
    partial = path.with_suffix(".part.npz")
    np.savez_compressed(
        partial,
        told=json.dumps(told | {"rows": rows, "dof": table.dof}),
        q=np.array([r.q for r in table.rows], dtype=np.float32),
        unsure=np.array([r.unsure for r in table.rows], dtype=np.float32),
        size=table.size,
        run=table.run,
        block=table.block,
        output=np.array(table.output),
    )
    partial.replace(path)


def read(path: Path) -> tuple[ScoreTable, dict[str, Any]]:
    """What `write` kept."""
    with np.load(path) as kept:
        told = json.loads(str(kept["told"]))
        rows = [
            Row(
                Kind(r["kind"]),
                tuple(r["names"]),
                q.astype(float),
                u.astype(float),
                r["parent"],
                r["moved"],
            )
            for r, q, u in zip(told["rows"], kept["q"], kept["unsure"], strict=True)
        ]
        empty = ScoreTable(
            (), kept["size"], kept["run"], kept["block"],
            tuple(str(k) for k in kept["output"]), told["dof"],
        )  # fmt: skip
    return replace(empty, rows=tuple(rows)), told
