"""What the makers of banks share: parts that are made once, a key that lies apart, its hash."""

import secrets
import shutil
import sys
import time
from collections.abc import Callable, Mapping
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from evaluation.bank import files
from evaluation.bank.recorder import Run
from evaluation.errors import BankError
from evaluation.plant.effects import BY_NAME, Active
from evaluation.plant.layout import READINGS

Array = NDArray[np.float64]
Entry = dict[str, Any]

SEALED = "sealed"
SIGNALS = (
    "i_meas_x_A", "i_meas_y_A", "v_x_V", "v_y_V", "rtd_x_degC", "rtd_y_degC", "displacement_mm",
    "force_N",
)  # fmt: skip
_COLUMNS = [READINGS.index(s) for s in SIGNALS]
_LEAST_GAP = 0.01


@dataclass(frozen=True, kw_only=True)
class Order:
    """A bank to make. `seed` None: drawn in secret, and kept only until the bank is made.

    `sealed`: effects of no list are those that nobody has looked at. `minutes`: stop after so long;
    the same order goes on.
    """

    folder: Path
    seed: int | None = None
    sealed: bool = False
    jobs: int = 2
    minutes: float = float("inf")

    @property
    def name(self) -> str:
        """What manifest and key call the bank."""
        return SEALED if self.sealed else self.folder.name

    @property
    def key_folder(self) -> Path:
        """The key, and what is needed to resume."""
        return self.folder.with_name(f"{self.folder.name}-key")

    @property
    def parts(self) -> Path:
        """Parts of an unfinished bank."""
        return self.key_folder / "parts"


Ordered = TypeVar("Ordered", bound=Order)


def begun(order: Ordered) -> Ordered:
    """The order with its seed, which is drawn or found where the bank was begun.

    Raises BankError when a finished bank or another order's is in the way.
    """
    if (order.folder / "manifest.json").exists():
        raise BankError(f"{order.folder} is already made: give another folder, or remove it")
    options = {k: str(v) for k, v in asdict(order).items() if k not in ("jobs", "minutes")}
    path = order.parts / "order.json"
    if not path.exists():
        if order.folder.exists() or order.key_folder.exists():
            raise BankError(
                f"{order.folder} or its key exists: give another folder, or remove both"
            )
        order.parts.mkdir(parents=True)
        seed = secrets.randbits(48) if order.seed is None else order.seed
        files.write_json(path, {"seed": seed, "asked": options})
    stored = files.read_json(path)
    if stored["asked"] != options:
        raise BankError(
            f"{order.folder} was begun with other options ({stored['asked']}): repeat those, or "
            f"remove it and {order.key_folder}"
        )
    return replace(order, seed=int(stored["seed"]))


def made(
    order: Order, until: float, make: Callable[..., Any], work: Mapping[str, tuple[Any, ...]]
) -> dict[str, Any] | None:
    """What `make` gives for all `work`, by name; parts that exist are not made again.

    None when `until` (monotonic seconds) came before the end.
    """
    missing = [n for n in work if not (order.parts / f"{n}.json").exists()]
    running: dict[Future[Any], str] = {}
    with ProcessPoolExecutor(order.jobs) as pool:
        while missing or running:
            while missing and len(running) < order.jobs and time.monotonic() < until:
                name = missing.pop(0)
                running[pool.submit(make, *work[name])] = name
            if not running:
                return None
            for future in wait(running, return_when=FIRST_COMPLETED).done:
                files.write_json(order.parts / f"{running.pop(future)}.json", future.result())
                pending = len(missing) + len(running)
                print(f"\r{len(work) - pending}/{len(work)} ", end="", file=sys.stderr, flush=True)
    return {n: files.read_json(order.parts / f"{n}.json") for n in work}


def sealed_up(order: Order, cases: Mapping[str, tuple[Entry, Entry]], manifest: Entry) -> str:
    """Write manifest and key of a bank whose runs are made, forget its parts; the key's SHA-256."""
    key = {
        "format": "smad-key-1",
        "bank": order.name,
        "runs_sha256": files.digest_of_runs(order.folder),
        "cases": {n: c[1] for n, c in cases.items()},
    }
    path = order.key_folder / "KEY.json"
    files.write_json(path, key)
    sha256 = files.digest(path)
    whole = {
        "bank": order.name,
        "key_sha256": sha256,
        "columns": files.UNITS,
        "cases": [c[0] for c in cases.values()],
        **manifest,
    }
    files.write_json(order.folder / "manifest.json", whole)
    shutil.rmtree(order.parts)
    return sha256


def rms_difference(runs: list[Run], other: list[Run]) -> Array:
    """RMS of what two recordings of the same runs differ by, for each of `SIGNALS`."""
    off = [(a.grid - b.grid)[:, _COLUMNS] for a, b in zip(runs, other, strict=True)]
    return np.asarray(np.sqrt(np.mean(np.concatenate(off) ** 2, axis=0)))


def raised(active: tuple[Active, ...], tried: Array, target: float) -> tuple[Active, ...]:
    """Effects that gave the gaps `tried`, scaled to `target` floors within their limits."""
    factor = target / max(float(tried.max()), _LEAST_GAP)
    out = []
    for a in active:
        limit = BY_NAME[a.name].limit
        out.append(replace(a, magnitude=float(np.clip(a.magnitude * factor, -limit, limit))))
    return tuple(out)


def answer(kind: str, active: tuple[Active, ...], target: float, gap: Array) -> Entry:
    """What the key says of any case: its effects with their truth, and its gaps in floors."""
    return {
        "kind": kind,
        "target_floors": round(target, 4) if active else 0.0,
        "gap_worst": round(float(gap.max()), 4),
        "gap_paired": {s: round(float(g), 3) for s, g in zip(SIGNALS, gap, strict=True)},
        "effects": [
            {
                "name": a.name,
                "known": BY_NAME[a.name].kind == "known",
                "subsystem": BY_NAME[a.name].subsystem,
                "magnitude": a.magnitude,
                "unit": BY_NAME[a.name].unit,
                "x_share": a.x_share,
                "y_share": a.y_share,
                "shape": a.shape,
                "places": BY_NAME[a.name].places,
                "states": BY_NAME[a.name].states,
                "side": a.side,
                "equation": BY_NAME[a.name].form,
            }
            for a in active
        ],
    }
