"""Make a bank: cases in parallel from one seed, resumable, with the key kept apart."""

import os
import secrets
import shutil
import sys
import threading
import time
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass
from multiprocessing import get_context, parent_process
from pathlib import Path
from typing import Any, TextIO

from tests.withheld import files
from tests.withheld.cases import DEFAULT, DIFFERS, FULL, MINI, Case, draw, scaled
from tests.withheld.errors import BankError
from tests.withheld.making import Style, make, sisters
from tests.withheld.plant.effects import names

DEV_SEED = 20260
MINI_SEED = 7
SISTERS = 6


@dataclass(frozen=True)
class Order:
    """What to make. `seed` None: fixed for dev and mini, drawn in secret for a sealed bank."""

    bank: str
    out: Path
    cases: int | None = None
    full: bool = False
    seed: int | None = None
    jobs: int = 2
    suffix: str = ".parquet"

    @property
    def folder(self) -> Path:
        """The bank itself, which may be given away."""
        return self.out / self.bank

    @property
    def key_folder(self) -> Path:
        """The key, and what is needed to resume."""
        return self.out / f"{self.bank}-key"


def _settled_seed(order: Order) -> int:
    path = order.key_folder / "seed.json"
    if path.exists():
        before = int(files.read_json(path)["seed"])
        if order.seed not in (None, before):
            raise BankError(
                f"{order.key_folder} was begun with another seed than {order.seed}: "
                "remove it and the bank folder, or leave --seed out to resume"
            )
        return before
    fixed = {"dev": DEV_SEED, "mini": MINI_SEED}
    seed = order.seed if order.seed is not None else fixed.get(order.bank, secrets.randbits(48))
    files.write_json(path, {"seed": seed})
    return seed


def planned(order: Order, seed: int) -> tuple[list[Case], Style]:
    """The cases of an order and how they are made."""
    if order.bank == "mini":
        counts = scaled(MINI, order.cases) if order.cases else MINI
        return draw("mini", seed, counts, 0), Style(40.0, order.suffix, search=False)
    counts = FULL if order.full else DEFAULT
    if order.cases:
        counts = scaled(counts, order.cases)
    differs = DIFFERS if not order.cases else 1
    return draw(order.bank, seed, counts, differs), Style(75.0, order.suffix)


def _end_with_the_parent() -> None:
    """A worker's first act: a maker that is killed must not leave its workers computing."""

    def wait() -> None:
        parent = parent_process()
        if parent is not None:
            parent.join()
            os._exit(1)

    threading.Thread(target=wait, daemon=True).start()


def _make_one(case: Case, folder: Path, style: Style) -> tuple[str, dict[str, Any]]:
    manifest, key = make(case, folder, style)
    return case.name, {"manifest": manifest, "key": key}


def _missing(case: Case, order: Order) -> bool:
    part = order.key_folder / "parts" / f"{case.name}.json"
    if not part.exists():
        return True
    runs = files.read_json(part)["manifest"]["runs"]
    return not all((order.folder / run["file"]).exists() for run in runs)


def _run_missing(order: Order, cases: list[Case], style: Style, tell: TextIO) -> None:
    todo = [case for case in cases if _missing(case, order)]
    begun = time.monotonic()
    done = 0

    def finish(name: str, part: dict[str, Any]) -> None:
        nonlocal done
        files.write_json(order.key_folder / "parts" / f"{name}.json", part)
        done += 1
        spent = time.monotonic() - begun
        left = spent / done * (len(todo) - done)
        ready = len(cases) - len(todo) + done
        print(f"\r{ready}/{len(cases)} cases, about {left / 60:.1f} min left ",
              end="", file=tell, flush=True)  # fmt: skip

    if order.jobs <= 1:
        for case in todo:
            finish(*_make_one(case, order.folder, style))
    else:
        spawn = get_context("spawn")
        with ProcessPoolExecutor(order.jobs, spawn, _end_with_the_parent) as pool:
            waiting = [pool.submit(_make_one, case, order.folder, style) for case in todo]
            for future in as_completed(waiting):
                finish(*future.result())
    print(file=tell)


def make_bank(order: Order, tell: TextIO = sys.stderr) -> str:
    """Make or resume a bank; the SHA-256 of its key.

    The bank is `order.folder` (manifest.json, cases/, sisters/), the key
    `order.key_folder/KEY.json`. Raises BankError when a finished bank is in the way.
    """
    if (order.folder / "manifest.json").exists():
        raise BankError(f"{order.folder} is already made: remove it, or choose another --out")
    (order.key_folder / "parts").mkdir(parents=True, exist_ok=True)
    order.folder.mkdir(parents=True, exist_ok=True)
    seed = _settled_seed(order)
    cases, style = planned(order, seed)
    _run_missing(order, cases, style, tell)
    parts = {c.name: files.read_json(order.key_folder / "parts" / f"{c.name}.json") for c in cases}
    good = sisters(seed, 1 if order.bank == "mini" else SISTERS, order.folder, style)
    key = {
        "format": "smad-key-1",
        "bank": order.bank,
        "seed": seed,
        "withheld_effects": list(names("sealed" if order.bank == "sealed" else "dev")),
        "cases": {name: part["key"] for name, part in parts.items()},
    }
    key_path = order.key_folder / "KEY.json"
    files.write_json(key_path, key)
    sha256 = files.digest(key_path)
    manifest = {
        "format": files.FORMAT,
        "bank": order.bank,
        "key_sha256": sha256,
        "columns": files.UNITS,
        "good": good,
        "cases": [part["manifest"] for part in parts.values()],
    }
    files.write_json(order.folder / "manifest.json", manifest)
    shutil.rmtree(order.key_folder / "parts")
    return sha256
