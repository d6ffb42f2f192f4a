"""Public records of four systems: fetches them, checks their digests, and makes runs of them.

None is in this repository. Each is fetched once into a folder, or put there by hand.
"""

from __future__ import annotations

import csv
import hashlib
import io
import urllib.request
import zipfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from scipy.io import loadmat

from examples.public_records.emps import EMPS
from examples.public_records.silverbox import SILVERBOX
from examples.public_records.tanks import TANKS
from smad.diagnosis import Answer
from smad.diagnosis.plant import Array
from smad.diagnosis.runs import GapRun
from smad.errors import SmadError
from smad.simulators import Simulator, diagnose
from smad.simulators.columns import Table

SILVERBOX_S = 2**14 / 1e7
TANKS_S = 4.0
EMPS_S = 1e-3
"""Time from one sample of a record to the next (Wigren and Schoukens, equation 12)."""
LAP = 6240
"""Samples in which the programme of EMPS comes back to where it began."""
SILVERBOX_PART, _SETTLING = 1500, 100
"""Samples of a Silverbox run, so few that a row of the diagnosis is one: the circuit swings once in
nine. During the first of them the circuit still rings from earlier inputs: they are not judged."""
_TIMEOUT_S = 60.0


class RecordError(SmadError):
    """A record that cannot be fetched, or that differs from the published one."""


@dataclass(frozen=True)
class SplitRuns:
    """Runs to fit, and runs to judge on; without these a model fitted to the others judges each."""

    fit: list[Any]
    hold_out: list[Any]


@dataclass(frozen=True)
class Mjcf:
    """A MuJoCo model and the map of its parts."""

    model: Path
    map: Path


@dataclass(frozen=True)
class Record:
    """Published files: where they are, their digests, their columns, and a simulator of them.

    `files` has the SHA-256 of each by its name; line ends of a text count as LF, since copies with
    CRLF exist, too. The files are in one `archive`, or each has an address of its own. `runs` takes
    the columns of each file.
    """

    page: str
    archive: str
    files: Mapping[str, str]
    columns: tuple[str, ...]
    simulator: Simulator | Mjcf
    runs: Callable[..., SplitRuns]
    addresses: Mapping[str, str] = field(default_factory=dict)

    def diagnosed(self, fit: list[Any], hold_out: list[Any]) -> Answer:
        """The answer for these runs of the record."""
        of = self.simulator
        if isinstance(of, Simulator):
            return diagnose(fit, of, hold_out=hold_out)
        from smad.simulators.mjcf.asked import diagnose_mjcf

        return diagnose_mjcf(of.model, of.map, fit, hold_out=hold_out)

    def asked(self, folder: Path) -> SplitRuns:
        """The runs of the files in `folder`, fetched if they are not there.

        Raises RecordError where they cannot be fetched, or are not those that were published.
        """
        missing = [name for name in self.files if not (folder / name).exists()]
        if missing:
            self._fetch(missing, folder)
        return self.runs(*(self._read(folder / name) for name in self.files))

    def _fetch(self, names: Sequence[str], folder: Path) -> None:
        try:
            if self.addresses:
                found = {name: _fetched(self.addresses[name]) for name in names}
            else:
                archive = zipfile.ZipFile(io.BytesIO(_fetched(self.archive)))
                members = {Path(n).name: n for n in archive.namelist()}
                found = {name: archive.read(members[name]) for name in names}
        except (OSError, zipfile.BadZipFile, KeyError) as error:
            wanted = " and ".join(names)
            source = f"the archive of {self.page}"
            if self.addresses:
                source = " and ".join(self.addresses[name] for name in names)
            raise RecordError(
                f"{self.archive or self.page} gives no {wanted}",
                value=f"{type(error).__name__} {error}".strip(),
                action=f"put {wanted} from {source} into {folder}",
            ) from error
        folder.mkdir(parents=True, exist_ok=True)
        for name, content in found.items():
            (folder / name).write_bytes(content)

    def _read(self, path: Path) -> dict[str, Array]:
        content = path.read_bytes()
        if path.suffix == ".csv":
            content = content.replace(b"\r\n", b"\n")
        digest = hashlib.sha256(content).hexdigest()
        if digest != self.files[path.name]:
            raise RecordError(
                f"{path} is not the record that was published",
                value=f"SHA-256 {digest}",
                limit=self.files[path.name],
                action=f"delete it, or put there the one of {self.page}",
            )
        if path.suffix == ".mat":
            found = loadmat(io.BytesIO(content), variable_names=self.columns)
            return {name: found[name].ravel() for name in self.columns}
        # Lines end in a comma. A number for the whole record is in the first line.
        rows = [row for row in csv.reader(io.StringIO(content.decode())) if row]
        at = [rows[0].index(c) for c in self.columns]
        values = np.array([[float(row[i]) for i in at] for row in rows[1:]])
        return dict(zip(self.columns, values.T, strict=True))


def _fetched(address: str) -> bytes:
    with urllib.request.urlopen(address, timeout=_TIMEOUT_S) as answer:
        content: bytes = answer.read()
    return content


def _silverbox(columns: Mapping[str, Array]) -> SplitRuns:
    """Two of the ten multisines to fit; to judge on, a later one, and noise that grows beyond them.

    The last part of the noise is the loudest.
    """

    def run(name: str, start: int) -> GapRun:
        valid = np.arange(SILVERBOX_PART) >= _SETTLING
        t_s = np.arange(SILVERBOX_PART) * SILVERBOX_S
        u, y = (columns[c][start : start + SILVERBOX_PART] for c in ("V1", "V2"))
        return GapRun(name, t_s, {"input_V": u}, {"output_V": y}, valid=valid)

    return SplitRuns(
        [run("multisine 1", 40577), run("multisine 2", 49271)],
        [run("multisine 9", 110110), run("growing noise", 40577 - SILVERBOX_PART)],
    )


def _tanks(columns: Mapping[str, Array]) -> SplitRuns:
    """The estimation record to fit, the test record to judge on, as they were published."""

    def run(name: str, pump: Array, level: Array) -> GapRun:
        t_s = np.arange(len(pump)) * TANKS_S
        return GapRun(name, t_s, {"pump_V": pump}, {"level_V": level})

    return SplitRuns(
        [run("estimation", columns["uEst"], columns["yEst"])],
        [run("test", columns["uVal"], columns["yVal"])],
    )


def _emps(plain: Mapping[str, Array], pulsed: Mapping[str, Array]) -> SplitRuns:
    """The laps of the record to fit, those with pulses of force to judge on, as was published.

    A lap has every speed both ways. In half a lap, a law over the delayed force cannot be told from
    one over the direction.
    """

    def laps(name: str, columns: Mapping[str, Array]) -> list[GapRun]:
        position = columns["qm"]
        force = (columns["gtau"] * columns["vir"])[1:-1]
        rate = (position[2:] - position[:-2]) / (2.0 * EMPS_S)
        found = []
        for i in range(round(len(rate) / LAP)):
            part = slice(i * LAP, (i + 1) * LAP)
            u, y = force[part], rate[part]
            t_s = np.arange(len(y)) * EMPS_S
            found.append(GapRun(f"{name} {i + 1}", t_s, {"force_N": u}, {"position_rate": y}))
        return found

    return SplitRuns(laps("lap", plain), laps("lap with pulses", pulsed))


def _pendulum(ddp: Mapping[str, Array], collocation: Mapping[str, Array]) -> SplitRuns:
    """Two swing-ups with trajectories of two planners, as they were recorded."""
    runs = {"ddp": ddp, "direct collocation": collocation}
    return SplitRuns(
        [
            Table(name, c["time"], {n: y for n, y in c.items() if n != "time"})
            for name, c in runs.items()
        ],
        [],
    )


_HERE = Path(__file__).parent
_DFKI = "dfki-ric-underactuated-lab/torque_limited_simple_pendulum"
_DFKI_FILES = (
    f"https://raw.githubusercontent.com/{_DFKI}/ed17ea2d32a35ad944944ca03ef57693e2986732/results"
)
RECORDS = {
    "silverbox": Record(
        "https://www.nonlinearbenchmark.org/benchmarks/silverbox",
        "https://drive.google.com/uc?export=download&id=17iS-6oBUUgrmiAcrZoG9S5sOaljZnDSy",
        {"SNLS80mV.csv": "ae62d5a91230c10f76e6dd02c8a4fac3c9d4d8a95fbf50e87cb0c4885003e0f1"},
        ("V1", "V2"),
        SILVERBOX,
        _silverbox,
    ),
    "tanks": Record(
        "https://www.nonlinearbenchmark.org/benchmarks/cascaded-tanks",
        "https://data.4tu.nl/file/d4810b78-6cdd-48fe-8950-9bd601e5f47f/3b697e42-01a4-4979-a370-813a456c36f5",
        {"dataBenchmark.csv": "ef2388ed822f3aef4aa80d6b0f2b466dd80b361786b3eafc7a2957c31ea323a7"},
        ("uEst", "uVal", "yEst", "yVal"),
        TANKS,
        _tanks,
    ),
    "emps": Record(
        "https://www.nonlinearbenchmark.org/benchmarks/emps",
        "https://drive.google.com/uc?export=download&id=1zwoXYa9-3f8NQ0ohzmjpF7UxbNgRTHkS",
        {
            "DATA_EMPS.mat": "6cf6814ae14618795da0101aae2bb97ff0c6351b0501b5492751b02b07facf7e",
            "DATA_EMPS_PULSES.mat": (
                "0eab75bb1f6b16228ee78791343a88bf9bfd9a51036ac9807d7b5fc11c0e1704"
            ),
        },
        ("vir", "qm", "gtau"),
        EMPS,
        _emps,
    ),
    "pendulum": Record(
        f"https://github.com/{_DFKI}",
        "",
        {
            "pendulum-ddp.csv": "14748fd189abae7b6392a016f2f0494b54bb2a8c014bc435a84b58dbecb2da35",
            "pendulum-collocation.csv": (
                "c3f990980169815b93ab37078780e13803327dcb6fc9e019f2d261b988cdaf8f"
            ),
        },
        ("time", "position", "velocity", "torque"),
        Mjcf(_HERE / "pendulum.xml", _HERE / "pendulum.toml"),
        _pendulum,
        {
            "pendulum-ddp.csv": f"{_DFKI_FILES}/control_method_ddp/data_measured.csv",
            "pendulum-collocation.csv": (
                f"{_DFKI_FILES}/control_method_direct_collocation/data_measured.csv"
            ),
        },
    ),
}
