"""Public records of two benchmarks: where they are, whether they are what they were, as runs.

Neither is in this repository. Each is fetched once into a folder, or put there by hand.
"""

from __future__ import annotations

import csv
import hashlib
import io
import urllib.request
import zipfile
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from examples.public_records.silverbox import RATE_HZ, Silverbox
from examples.public_records.tanks import STEP_S, Tanks
from smad.diagnosis.plant import Array, PlantModel
from smad.diagnosis.runs import GapRun
from smad.errors import SmadError

_TIMEOUT_S = 60.0
_SETTLING = 100
"""Samples at the start of a Silverbox run in which the run before still rings: not judged."""


class RecordError(SmadError):
    """A record that cannot be had, or is not the one that was published."""


@dataclass(frozen=True)
class Asked:
    """Runs to fit, and runs to judge on."""

    fit: list[GapRun]
    hold_out: list[GapRun]


@dataclass(frozen=True)
class Record:
    """A published file: where it is, its digest, its columns, and the plant that it is of.

    `sha256` is of the file with line ends of one character, since copies of both kinds are about.
    """

    page: str
    archive: str
    file: str
    sha256: str
    columns: tuple[str, ...]
    plant: PlantModel
    runs: Callable[[Mapping[str, Array]], Asked]

    def asked(self, folder: Path) -> Asked:
        """The runs of the file in `folder`, fetched if it is not there.

        Raises RecordError where it cannot be fetched, or is not the one that was published.
        """
        path = folder / self.file
        if not path.exists():
            folder.mkdir(parents=True, exist_ok=True)
            path.write_bytes(self._fetched(path))
        content = path.read_bytes().replace(b"\r\n", b"\n")
        digest = hashlib.sha256(content).hexdigest()
        if digest != self.sha256:
            raise RecordError(
                f"{path} is not the record that was published",
                value=f"SHA-256 {digest}",
                limit=self.sha256,
                action=f"delete it, or put there the one of {self.page}",
            )
        return self.runs(self._read(content.decode()))

    def _fetched(self, path: Path) -> bytes:
        by_hand = f"put {self.file} from the archive of {self.page} into {path.parent}"
        try:
            with urllib.request.urlopen(self.archive, timeout=_TIMEOUT_S) as answer:
                archive = zipfile.ZipFile(io.BytesIO(answer.read()))
            name = next(n for n in archive.namelist() if Path(n).name == self.file)
            return archive.read(name)
        except (OSError, zipfile.BadZipFile, StopIteration) as error:
            why = f"{type(error).__name__} {error}".strip()
            raise RecordError(
                f"{self.archive} gives no {self.file}", value=why, action=by_hand
            ) from error

    def _read(self, text: str) -> dict[str, Array]:
        # Lines end in a comma, and what is one number for the whole record stands in the first.
        rows = [row for row in csv.reader(io.StringIO(text)) if row]
        at = [rows[0].index(c) for c in self.columns]
        values = np.array([[float(row[i]) for i in at] for row in rows[1:]])
        return dict(zip(self.columns, values.T, strict=True))


def _silverbox(columns: Mapping[str, Array]) -> Asked:
    """Two of the ten multisines to fit; to judge on, a later one, and noise that grows beyond them.

    Each begins and ends where nothing is played.
    """

    def run(name: str, start: int, stop: int) -> GapRun:
        valid = np.arange(stop - start) >= _SETTLING
        t_s = np.arange(stop - start) / RATE_HZ
        u, y = (columns[c][start:stop] for c in ("V1", "V2"))
        return GapRun(name, t_s, {"input_V": u}, {"output_V": y}, valid)

    return Asked(
        [run("multisine 1", 40577, 49271), run("multisine 2", 49271, 57963)],
        [run("multisine 9", 110110, 118801), run("growing noise", 0, 40577)],
    )


def _tanks(columns: Mapping[str, Array]) -> Asked:
    """The estimation record to fit, the test record to judge on, as they were published."""

    def run(name: str, pump: Array, level: Array) -> GapRun:
        t_s = np.arange(len(pump)) * STEP_S
        return GapRun(name, t_s, {"pump_V": pump}, {"level_V": level})

    return Asked(
        [run("estimation", columns["uEst"], columns["yEst"])],
        [run("test", columns["uVal"], columns["yVal"])],
    )


RECORDS = {
    "silverbox": Record(
        "https://www.nonlinearbenchmark.org/benchmarks/silverbox",
        "https://drive.google.com/uc?export=download&id=17iS-6oBUUgrmiAcrZoG9S5sOaljZnDSy",
        "SNLS80mV.csv",
        "ae62d5a91230c10f76e6dd02c8a4fac3c9d4d8a95fbf50e87cb0c4885003e0f1",
        ("V1", "V2"),
        Silverbox(),
        _silverbox,
    ),
    "tanks": Record(
        "https://www.nonlinearbenchmark.org/benchmarks/cascaded-tanks",
        "https://data.4tu.nl/file/d4810b78-6cdd-48fe-8950-9bd601e5f47f/3b697e42-01a4-4979-a370-813a456c36f5",
        "dataBenchmark.csv",
        "ef2388ed822f3aef4aa80d6b0f2b466dd80b361786b3eafc7a2957c31ea323a7",
        ("uEst", "uVal", "yEst", "yVal"),
        Tanks(),
        _tanks,
    ),
}
