"""Kinds of faulty records and every reader that they come in by: what each says of each.

`python -m tests.smad.records.kinds` prints the table; `test_kinds.py` holds it to what is right.
"""

from __future__ import annotations

import contextlib
import functools
import tempfile
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from sim_device.plant.errors import PlantError
from smad.diagnosis.data.admission import admit
from smad.diagnosis.data.doubts import doubted_columns
from smad.diagnosis.plant import (
    Array,
    Channel,
    Mask,
    ModelPoint,
    Parameter,
    PlantModel,
    Signal,
    nominal_replay,
)
from smad.diagnosis.runs import GapRun
from smad.diagnosis.spring_pair import SmaPlant, read_gap_run
from smad.diagnosis.spring_pair.signals import read_recorded
from smad.errors import SmadError
from smad.fmi.map_file import read_map
from smad.records.importer import import_table
from smad.runlog.header import RunHeader
from smad.runlog.schema import Row
from smad.runlog.writer import write_run
from tests.smad.fmi.heater import MAP, read_mapped

Columns = dict[str, Array]


@dataclass(frozen=True)
class RecordedBench:
    """What was recorded: columns without a fault, the input and the reading that get one."""

    columns: Mapping[str, Array]
    driven: str
    read: str
    high: float
    inputs: tuple[str, ...]


class Heater:
    """The heater of the map as a plant in Python."""

    name, version = "heater", "1"
    inputs = (Signal("power_W", "W", 0.0, 50.0),)
    channels = (
        Channel(
            name="temperature_degC", unit="degC", quantum=0.01, low=-20.0, high=150.0, noise=0.03
        ),
    )
    parameters = (Parameter(name="loss", unit="W/K", nominal=0.6, low=0.4, high=1.1, prior_sd=0.1),)
    effects = ()

    def simulate(self, point: ModelPoint, run: GapRun, *, fast: bool = False) -> dict[str, Array]:
        loss, plate = point.theta.get("loss", 0.6), 22.0
        out = np.empty(len(run.t_s))
        for k, power in enumerate(run.inputs["power_W"]):
            out[k] = plate
            plate += run.dt_s * (power - loss * (plate - 22.0)) / 20.0
        return {"temperature_degC": out}

    def regimes(self, run: GapRun, side: str) -> dict[str, Mask]:
        return {"rest": np.cumsum(run.inputs["power_W"] > 0.5) == 0}


def heated(seed: int = 0, seconds: float = 60.0) -> RecordedBench:
    """A heater at 10 Hz: steps of power of up to 50 W."""
    n = round(10 * seconds)
    rng = np.random.default_rng(seed)
    power = np.repeat(rng.choice([0.0, 15.0, 30.0, 50.0], n // 50 + 1), 50)[:n]
    power[:50], power[100:150] = 0.0, 50.0
    run = GapRun("heater", np.arange(n) * 0.1, {"power_W": power}, {})
    clean = Heater().simulate(ModelPoint({"loss": 0.62}), run)["temperature_degC"]
    shown = np.round((clean + 0.03 * rng.standard_normal(n)) / 0.01) * 0.01
    columns = {"t_s": run.t_s, "power_W": power, "temperature_degC": shown}
    return RecordedBench(columns, "power_W", "temperature_degC", 50.0, ("power_W",))


@functools.cache
def pair() -> RecordedBench:
    """The spring pair at 100 Hz for 30 s, heated and cooled in the open loop."""
    from smad.diagnosis.spring_pair.recorded import recorded

    run = recorded("pulses", SmaPlant(), ModelPoint({}), 3, duration_s=30.0)
    columns = {"t_s": run.t_s, **run.inputs, **run.outputs}
    return RecordedBench(columns, "i_applied_x_A", "rtd_x_degC", 4.0, tuple(run.inputs))


Fault = Callable[[Columns, RecordedBench], Columns]


def changed(name: str, change: Callable[[Array, RecordedBench], Array]) -> Fault:
    """A fault of the driven input ("driven") or of the reading ("read") alone."""

    def fault(columns: Columns, bench: RecordedBench) -> Columns:
        column = getattr(bench, name)
        return {**columns, column: change(columns[column].copy(), bench)}

    return fault


def at(share: float, values: Array) -> int:
    return int(share * len(values))


def put(values: Array, places: list[int] | slice, number: float) -> Array:
    values[places] = number
    return values


def hole(columns: Columns, bench: RecordedBench) -> Columns:
    t_s = columns["t_s"]
    kept = (t_s < t_s[-1] * 0.6) | (t_s > t_s[-1] * 0.6 + 1.0)
    return {name: column[kept] for name, column in columns.items()}


def undriven(columns: Columns, bench: RecordedBench) -> Columns:
    return columns | {name: np.zeros(len(columns["t_s"])) for name in bench.inputs}


def on_change(values: Array, bench: RecordedBench) -> Array:
    return np.where(np.diff(values, prepend=np.nan) == 0.0, np.nan, values)


def slower(values: Array, bench: RecordedBench) -> Array:
    return np.where(np.arange(len(values)) % 10 == 0, values, np.nan)


def stuck(values: Array, bench: RecordedBench) -> Array:
    """The reading stays for a tenth of the run as it was before it moved most."""
    n = len(values) // 10
    begin = int(np.argmax(np.abs(values[n:] - values[:-n])))
    return put(values, slice(begin, begin + n), values[begin])


def repeated(values: Array, bench: RecordedBench) -> Array:
    """The reading at a fifth of the rate, each value in five rows."""
    return np.repeat(values[::5], 5)[: len(values)]


def in_ms(columns: Columns, bench: RecordedBench) -> Columns:
    return columns | {"t_s": 1e3 * columns["t_s"]}


KINDS: dict[str, Fault] = {
    "nothing": lambda columns, bench: columns,
    "a hole of 1 s": hole,
    "counts of 8 bits": changed("driven", lambda v, b: np.rint(v * 255.0 / b.high)),
    "thousandths": changed("driven", lambda v, b: 1e3 * v),
    "a reversed sign": changed("driven", lambda v, b: -v),
    "degrees Fahrenheit": changed("read", lambda v, b: 1.8 * (v + 60.0) + 32.0),
    "-127 in three samples": changed("read", lambda v, b: put(v, [90, 140, 141], -127.0)),
    "85 °C in one sample": changed("read", lambda v, b: put(v, [20], 85.0)),
    "9999 in one sample": changed("read", lambda v, b: put(v, [95], 9999.0)),
    "a jump of one sample": changed("read", lambda v, b: put(v, [25], v[25] + 40.0)),
    "NaN in ten samples": changed("read", lambda v, b: put(v, slice(100, 110), np.nan)),
    "an open sensor": changed("read", lambda v, b: put(v, slice(at(0.5, v), None), -127.0)),
    "a stuck channel": changed("read", stuck),
    "an input on change": changed("driven", on_change),
    "a slower channel": changed("read", slower),
    "a reading in five rows each": changed("read", repeated),
    "a time in ms": in_ms,
    "1.1 s long": lambda columns, bench: {n: c[columns["t_s"] < 1.1] for n, c in columns.items()},
    "no input changes": undriven,
    "another run's reading": changed("read", lambda v, b: v[::-1].copy()),
}


def as_csv(columns: Columns, path: Path) -> Path:
    rows = zip(*columns.values(), strict=True)
    cells = (["" if np.isnan(v) else repr(float(v)) for v in row] for row in rows)
    lines = [",".join(row) for row in ([*columns], *cells)]
    path.write_text("\n".join(lines) + "\n")
    return path


def as_log(columns: Columns, path: Path) -> Path:
    rows = (
        Row(**{n: None if np.isnan(v) else float(v) for n, v in zip(columns, row, strict=True)})
        for row in zip(*columns.values(), strict=True)
    )
    path.unlink(missing_ok=True)
    write_run(path, RunHeader(source="bench", name="a"), rows)
    return path


def as_parquet(columns: Columns, path: Path) -> Path:
    pq.write_table(pa.table({n: pa.array(c, from_pandas=True) for n, c in columns.items()}), path)
    return path


def admitted(run: GapRun, plant: PlantModel) -> str:
    """What the admission says of a run: refused or used, and why or with what left out."""
    found = admit([run], plant, 0.2)
    said = [f.text for f in found.findings if f.kind != "channel missing"]
    state = "used" if found.admitted else "refused"
    return f"{state}: {'; '.join(said)}" if said else state


def by_pair(write: Callable[[Columns, Path], Path], suffix: str) -> Callable[[Fault, Path], str]:
    def reader(fault: Fault, folder: Path) -> str:
        path = write(fault(dict(pair().columns), pair()), folder / f"a{suffix}")
        return admitted(read_gap_run(path), SmaPlant())

    return reader


def by_import(fault: Fault, folder: Path) -> str:
    path = as_csv(fault(dict(pair().columns), pair()), folder / "b.csv")
    (folder / "b.mcap").unlink(missing_ok=True)
    notes = import_table(path, folder / "b.mcap").notes
    return f"imported: {'; '.join(notes)}" if notes else "imported"


def by_check_up(fault: Fault, folder: Path) -> str:
    path = as_csv(fault(dict(pair().columns), pair()), folder / "c.csv")
    notes = read_recorded(path)[0].notes
    return f"read: {'; '.join(notes)}" if notes else "read"


def by_map(fault: Fault, folder: Path) -> str:
    path = as_csv(fault(dict(heated().columns), heated()), folder / "d.csv")
    (folder / "map.toml").write_text(MAP)
    return admitted(read_mapped(path, read_map(folder / "map.toml")), Heater())


def by_python(fault: Fault, folder: Path) -> str:
    columns = fault(dict(heated().columns), heated())
    t_s, power = columns["t_s"], columns["power_W"]
    shown = {"temperature_degC": columns["temperature_degC"]}
    return admitted(GapRun("a", t_s, {"power_W": power}, shown), Heater())


READERS: dict[str, Callable[[Fault, Path], str]] = {
    "run log": by_pair(as_log, ".mcap"),
    "CSV": by_pair(as_csv, ".CSV"),
    "Parquet": by_pair(as_parquet, ".parquet"),
    "log import": by_import,
    "check-up": by_check_up,
    "FMU map": by_map,
    "Python plant": by_python,
}


def outcome(kind: str, reader: str, folder: Path) -> str:
    """What a reader says of a kind, in a line."""
    try:
        return READERS[reader](KINDS[kind], folder)
    except SmadError as error:
        return f"refused: {error}"


Misreading = Callable[[Columns], Columns]


def scaled(ends: str, scale: float, offset: float = 0.0) -> Misreading:
    """Every column whose name ends so is read as its number in another unit."""
    return lambda columns: {
        n: c * scale + offset if n.endswith(ends) else c for n, c in columns.items()
    }


def exchanged(*stems: str) -> Misreading:
    """Inputs of X and Y of these stems are exchanged."""

    def fault(columns: Columns) -> Columns:
        pairs = [(f"{s}_x{end}", f"{s}_y{end}") for s in stems for end in ("", "_A")]
        names = {a: b for x, y in pairs for a, b in ((x, y), (y, x))}
        return {n: columns[names.get(n, n)] for n in columns}

    return fault


MISREADINGS: dict[str, tuple[Misreading, str]] = {
    "nothing misread": (lambda columns: columns, ""),
    "all temperatures in °F": (scaled("degC", 1.8, 32.0), "in degF"),
    "a temperature in °F": (scaled("rtd_x_degC", 1.8, 32.0), "is rtd_x_degC in degF"),
    "force in lbf": (scaled("force_N", 1.0 / 4.448), "in lbf"),
    "force in kgf": (scaled("force_N", 1.0 / 9.807), "in kgf"),
    "displacement in inches": (scaled("displacement_mm", 1.0 / 25.4), "in in"),
    "displacement of the other sign": (scaled("displacement_mm", -1.0), "of the other sign"),
    "currents exchanged": (exchanged("i_applied"), "i_applied_y_A exchanged"),
    "springs exchanged": (exchanged("i_applied", "duty"), "duty_y exchanged"),
}
"""What is misread within its range, and words by which it is named."""


def benches(count: int) -> list[tuple[bool, GapRun]]:
    """Runs of simulated pairs whose parameters are moved as their priors say; every second one has
    an effect of one to three times its usual size."""
    from smad.diagnosis.spring_pair.recorded import recorded

    plant, out = SmaPlant(), list[tuple[bool, GapRun]]()
    programmes = ("pulses", "levels", "sines", "stairs", "mixed", "quick levels")
    for k in range(count):
        rng = np.random.default_rng([7, k])
        drawn = [(q, q.nominal + q.prior_sd * rng.standard_normal()) for q in plant.parameters]
        theta = {q.name: float(np.clip(value, q.low, q.high)) for q, value in drawn}
        effect = plant.effects[int(rng.integers(len(plant.effects)))]
        times = rng.uniform(1.0, 3.0)
        values = {
            q.name: float(np.clip(q.typical * (times if q.strength else 1.0), q.low, q.high))
            for q in effect.parameters
        }
        point = ModelPoint(theta, {effect.name: values} if k % 2 else {})
        # Some draws are no set of parameters: martensite would finish before it starts.
        with contextlib.suppress(SmadError, PlantError):
            run = recorded(programmes[k // 2 % 6], plant, point, k, duration_s=60.0)
            out.append((bool(k % 2), run))
    return out


def misread(count: int = 40) -> list[str]:
    """For each misreading, how many runs are doubted, and how many rightly."""
    runs, plant, lines = benches(count), SmaPlant(), list[str]()
    for name, (change, words) in MISREADINGS.items():
        for faulty, title in ((False, "healthy"), (True, "with an effect")):
            said = []
            for run in (r for f, r in runs if f == faulty):
                columns = change({**run.inputs, **run.outputs})
                read = run.with_columns(
                    {n: columns[n] for n in run.inputs}, {n: columns[n] for n in run.outputs}
                )
                said.append(doubted_columns(plant, read, nominal_replay(read, plant)))
            right = sum(any(words in text for text in texts) for texts in said) if words else 0
            lines.append(
                f"{name}, benches {title}: {sum(map(bool, said))} of {len(said)} doubted, "
                f"{right} by its name"
            )
    return lines


def main() -> None:
    with tempfile.TemporaryDirectory() as name:
        for kind in KINDS:
            print(kind)
            for reader in READERS:
                print(f"  {reader:<13} {outcome(kind, reader, Path(name))}".replace(name, "…"))
    print("misread within the range", *misread(), sep="\n  ")


if __name__ == "__main__":
    main()
