"""One simulated pendulum with a hidden friction, asked by four plants of the same physics."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from evaluation.simulators.pendulum import as_class, as_function
from smad.diagnosis import Answer, diagnose
from smad.diagnosis.plant import Array
from smad.diagnosis.runs import GapRun
from smad.simulators import diagnose as diagnose_simulator

FRICTION_N_M = 0.06
_HOME = Path(__file__).with_name("pendulum")
_FINE = 20
_DT_S = 0.01
_PIECE = 150


@dataclass(frozen=True, kw_only=True)
class Row:
    """What one plant answered: its first place, the friction with its deviation, and the cost.

    `friction` is the size of the effect, or the coefficient of the sign of the rate in a law there;
    `lines` are those that a user writes beside a model that exists.
    """

    plant: str
    place: str
    friction: float
    sd: float
    name: str
    seconds: float
    lines: int


def made_run(seed: int, friction: float = FRICTION_N_M, seconds: float = 12.0) -> dict[str, Array]:
    """A run of the bench, integrated in steps of half a millisecond."""
    rng = np.random.default_rng(seed)
    t_s = np.arange(round(seconds / _DT_S)) * _DT_S
    knots = np.arange(0.0, seconds + 0.5, 0.5)
    torque = np.interp(t_s, knots, rng.uniform(-1.5, 1.5, len(knots)))
    angle = rate = 0.0
    mass, damping, dt = 1.1, 0.04, _DT_S / _FINE
    inertia, angles = mass * 0.5**2, []
    for push in torque.tolist():
        angles.append(angle)
        for _ in range(_FINE):
            force = push - damping * rate - 9.81 * 0.5 * mass * float(np.sin(angle))
            rate += dt * force / inertia
            stopped = dt * friction / inertia
            rate -= min(max(rate, -stopped), stopped)
            angle += dt * rate
    read = np.array(angles) + 1e-3 * rng.standard_normal(len(t_s))
    return {"t_s": t_s, "torque_N_m": torque, "angle_rad": np.round(read, 4)}


def side_by_side(folder: Path, which: tuple[str, ...] = (), runs: int = 4) -> list[Row]:
    """Ask each of the plants; `folder` takes the unit and the files of the runs."""
    tables = [made_run(seed) for seed in range(runs)]
    questions: Mapping[str, Callable[[], Answer]] = {
        "function": lambda: diagnose_simulator(tables, as_function.PLANT),
        "MuJoCo": lambda: _mujoco(tables),
        "FMU": lambda: _unit(folder, tables),
        "own class": lambda: diagnose(_pieces(tables), plant=as_class.PLANT),
    }
    written = {
        "function": ["as_function.py"], "MuJoCo": ["mujoco_map.toml"], "FMU": ["unit_map.toml"],
        "own class": ["as_class.py"],
    }  # fmt: skip
    out = []
    for name, ask in questions.items():
        if which and name not in which:
            continue
        began = time.process_time()
        verdict = ask().verdict
        seconds = time.process_time() - began
        place, friction, sd, named = "none", np.nan, np.nan, ""
        if verdict.causes:
            first = verdict.causes[0]
            place = first.place
            named = max(first.names, key=lambda n: first.names[n], default="")
            for value in first.values:
                if "friction" in first.name:
                    friction, sd = abs(value.value), value.sd or np.nan
            for term in first.terms:
                if term.name.endswith("_rate_sign"):
                    friction, sd = -term.slopes["both"], term.sd["both"]
        out.append(
            Row(
                plant=name,
                place=place,
                friction=friction,
                sd=sd,
                name=named,
                seconds=seconds,
                lines=sum(lines_of(_HOME / f) for f in written[name]),
            )
        )
    return out


def _mujoco(tables: list[dict[str, Array]]) -> Answer:
    from smad.simulators.mjcf.asked import diagnose_mjcf

    return diagnose_mjcf(_HOME / "model.xml", _HOME / "mujoco_map.toml", tables)


def _unit(folder: Path, tables: list[dict[str, Array]]) -> Answer:
    import shutil

    from pythonfmu.builder import FmuBuilder

    from smad.fmi.asked import diagnose_unit

    script = folder / "script" / "pendulum.py"
    script.parent.mkdir(parents=True, exist_ok=True)
    shutil.copyfile(_HOME / "unit_script.py", script)
    built: Any = FmuBuilder.build_FMU(script, dest=folder / "pendulum.fmu")
    paths = []
    for k, table in enumerate(tables):
        path = folder / f"run{k}.csv"
        np.savetxt(
            path,
            np.column_stack(list(table.values())),
            delimiter=",",
            header=",".join(table),
            comments="",
        )
        paths.append(path)
    return diagnose_unit(Path(built), _HOME / "unit_map.toml", paths)


def _pieces(tables: list[dict[str, Array]]) -> list[GapRun]:
    """Whole runs are lost by a pendulum; a class of one's own is given pieces."""
    out = []
    for k, table in enumerate(tables):
        run = GapRun(
            f"run {k}",
            table["t_s"],
            {"torque_N_m": table["torque_N_m"]},
            {"angle_rad": table["angle_rad"]},
        )
        out += [run.part(a, a + _PIECE) for a in range(0, len(run.t_s) - _PIECE + 1, _PIECE)]
    return out


def lines_of(path: Path) -> int:
    """Lines of a file that are neither empty nor a comment."""
    lines = (line.strip() for line in path.read_text("utf-8").splitlines())
    return sum(1 for line in lines if line and not line.startswith("#"))


def table_of(rows: list[Row]) -> list[str]:
    """The rows as a table of Markdown."""
    out = ["| plant | first place | friction [N m] | likeliest name | s | lines |",
           "|---|---|---:|---|---:|---:|"]  # fmt: skip
    for r in rows:
        friction = "—" if np.isnan(r.friction) else f"{r.friction:.4f} ± {r.sd:.1g}"
        out.append(
            f"| {r.plant} | {r.place} | {friction} | {r.name} | {r.seconds:.0f} | {r.lines} |"
        )
    return out
