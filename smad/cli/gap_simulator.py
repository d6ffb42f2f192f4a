"""Options of `smad gap` for a simulator that is not ours: a unit of FMI, a MuJoCo model."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import click

from smad.cli.output import note, progress
from smad.cli.quantity import Quantity, Whole

if TYPE_CHECKING:
    from smad.diagnosis.answer import Answer
    from smad.records.channels import MappingFile

_FILE = click.Path(exists=True, dir_okay=False, path_type=Path)
_F = TypeVar("_F", bound=Callable[..., Any])


def simulator_options(command: _F) -> _F:
    """Add --fmu, --mjcf, --map and --window to a command."""
    for option in (
        click.option(
            "--window",
            "window_s",
            type=Quantity("s", 0.0),
            metavar="S",
            help="With --mjcf: replay windows of this length; 0: whole runs "
            "(default: chosen and reported).",
        ),
        click.option(
            "--map",
            "map_path",
            type=_FILE,
            help="TOML file that maps columns to variables or parts of a simulator.",
        ),
        click.option("--mjcf", type=_FILE, help="Use this MuJoCo model; needs --map."),
        click.option(
            "--fmu",
            type=_FILE,
            help="Use this FMI 2.0 unit as the model; needs --map. Runs its code.",
        ),
    ):
        command = option(command)
    return command


processes_option = click.option(
    "--processes",
    type=Whole(1),
    metavar="N",
    help="With --mjcf or --fmu: number of processes (default: 1; all idle cores for a slow MuJoCo "
    "model).",
)


def require_pairs(
    fmu: Path | None, mjcf: Path | None, map_path: Path | None, window_s: float | None
) -> None:
    """Raise UsageError for options that do not belong together."""
    if fmu is not None and mjcf is not None:
        raise click.UsageError("a model is one of --fmu and --mjcf; give one")
    if map_path is None and (fmu or mjcf):
        name = "--fmu" if fmu else "--mjcf"
        raise click.UsageError(f"{name} and --map belong together; give both")
    if window_s is not None and mjcf is None:
        raise click.UsageError("--window needs --mjcf; leave it out")


def mapping_of(map_path: Path) -> MappingFile:
    """Return the mapping file that --map alone names. Raises UsageError where it is none."""
    from smad.errors import LogImportError
    from smad.records.channels import read_mapping

    try:
        return read_mapping(map_path)
    except LogImportError as error:
        raise click.UsageError(
            f"{error}. If it is the map of a simulator, give --fmu or --mjcf, too"
        ) from None


def warn_that_code_runs(fmu: Path) -> None:
    """Say on stderr that a unit is a program."""
    note(
        f"smad: {fmu} contains code that runs with your permissions; "
        "use only units from sources you trust"
    )


def diagnose_simulator(
    runs: Sequence[Path],
    good: Sequence[Path],
    hold_out: Sequence[Path],
    trusted: Sequence[str],
    *,
    fmu: Path | None,
    mjcf: Path | None,
    map_path: Path,
    window_s: float | None,
    processes: int | None,
) -> Answer:
    """The answer for a simulator that is not ours."""
    with progress() as line:
        common: dict[str, Any] = {
            "good": good,
            "hold_out": hold_out,
            "trusted": trusted,
            "processes": processes,
            "progress": line.say,
            "announced": line.note,
        }
        if mjcf is not None:
            from smad.simulators.mjcf.asked import diagnose_mjcf

            return diagnose_mjcf(mjcf, map_path, runs, window_s=window_s, **common)
        from smad.fmi.asked import diagnose_unit

        assert fmu is not None
        warn_that_code_runs(fmu)
        return diagnose_unit(fmu, map_path, runs, **common)
