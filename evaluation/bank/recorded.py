"""Make a bank: cases in parallel from one seed, resumable, with the key kept apart."""

import os
import secrets
import shutil
import signal
import sys
import threading
import time
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor, as_completed
from contextlib import contextmanager
from dataclasses import dataclass
from multiprocessing import active_children, get_context, parent_process
from pathlib import Path
from typing import Any, TextIO

from evaluation.bank import files
from evaluation.bank.cases import DEFAULT, DIFFERS, FULL, MINI, Case, draw, scaled
from evaluation.bank.making import Style, make, sisters
from evaluation.errors import BankError
from evaluation.plant.effects import names

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
    differs: int = DIFFERS
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
        begun = files.read_json(path)
        before = int(begun["seed"])
        if order.seed not in (None, before):
            raise BankError(
                f"{order.key_folder} was begun with another seed than {order.seed}: "
                "remove it and the bank folder, or leave --seed out to resume"
            )
        # A seed that was written before the options were kept beside it has none to compare.
        for option, value in _draw(order).items():
            if begun.get(option, value) != value:
                raise BankError(
                    f"{order.key_folder} was begun with {_spoken(option, begun[option])}, "
                    f"not {_spoken(option, value)}: resume with the options it was begun with, "
                    "or remove it and the bank folder"
                )
        return before
    fixed = {"dev": DEV_SEED, "mini": MINI_SEED}
    seed = order.seed if order.seed is not None else fixed.get(order.bank, secrets.randbits(48))
    files.write_json(path, {"seed": seed} | _draw(order))
    return seed


def _draw(order: Order) -> dict[str, Any]:
    """What a draw and its files depend on beside the seed, by option of the command."""
    return {
        "cases": order.cases,
        "full": order.full and order.bank != "mini",
        "differs": order.differs,
        "csv": order.suffix != ".parquet",
    }


def _spoken(option: str, value: Any) -> str:
    if value is None or value is False:
        return f"no --{option}"
    return f"--{option}" if value is True else f"--{option} {value}"


def planned(order: Order, seed: int) -> tuple[list[Case], Style]:
    """The cases of an order and how they are made."""
    if order.bank == "mini":
        counts = scaled(MINI, order.cases) if order.cases else MINI
        return draw("mini", seed, counts, 0), Style(40.0, order.suffix, search=False)
    counts = FULL if order.full else DEFAULT
    if order.cases:
        counts = scaled(counts, order.cases)
    return draw(order.bank, seed, counts, order.differs), Style(75.0, order.suffix)


def _end_with_the_parent() -> None:
    """A worker's first act: a maker that is killed must not leave its workers computing.

    An interruption is the parent's business.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)

    def wait() -> None:
        parent = parent_process()
        if parent is not None:
            parent.join()
            os._exit(1)

    threading.Thread(target=wait, daemon=True).start()


@contextmanager
def _workers(jobs: int) -> Iterator[ProcessPoolExecutor]:
    """Worker processes; whatever ends the block early ends them and drops what waits."""
    before = set(active_children())
    pool = ProcessPoolExecutor(jobs, get_context("spawn"), _end_with_the_parent)
    try:
        yield pool
    except BaseException:
        for process in set(active_children()) - before:
            process.terminate()
        pool.shutdown(wait=False, cancel_futures=True)
        raise
    pool.shutdown()


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
        with _workers(order.jobs) as pool:
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
