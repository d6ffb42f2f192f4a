"""The diagnosis of runs of files."""

from collections.abc import Sequence
from pathlib import Path

from smad.diagnosis.answer import Answer
from smad.diagnosis.diagnose import diagnose
from smad.diagnosis.plant import PlantModel
from smad.diagnosis.spring_pair.signals import read_gap_runs
from smad.progress import Say
from smad.records.channels import MappingFile


def diagnose_files(
    plant: PlantModel,
    runs: Sequence[Path],
    good: Sequence[Path],
    hold_out: Sequence[Path],
    trusted: Sequence[str] = (),
    *,
    mapping: MappingFile | None = None,
    progress: Say,
) -> Answer:
    """Where the plant and the runs of files disagree; see `smad.diagnosis.diagnose`.

    `trusted` are names or paths of runs that the nominal model's opinion does not refuse;
    `mapping` says how tables are written.
    """
    every = (*runs, *good, *hold_out)
    fitted, known_good, judged_on = (
        read_gap_runs(paths, every, trusted, mapping, progress) for paths in (runs, good, hold_out)
    )
    return diagnose(fitted, plant=plant, good=known_good, hold_out=judged_on, progress=progress)
