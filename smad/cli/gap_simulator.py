"""Options of `smad gap` for a simulator that is not ours: a unit of FMI, a MuJoCo model."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from smad.cli.options import EXISTING, option
from smad.cli.quantity import Quantity, Whole
from smad.view.terminal.progress import note, progress

if TYPE_CHECKING:
    from smad.diagnosis.answer import Answer
    from smad.progress import Say
    from smad.records.channels import MappingFile
    from smad.simulators.planning import Plan


@dataclass(frozen=True, kw_only=True)
class Simulator:
    """A simulator that is not ours, with the files that a person names for it."""

    fmu: Path | None = option(
        "--fmu",
        "With --map, without --mjcf, --params or --variant: use this FMI 2.0 unit as the model. "
        "Runs its code.",
        EXISTING,
    )
    mjcf: Path | None = option(
        "--mjcf", "With --map, without --params or --variant: use this MuJoCo model.", EXISTING
    )
    map_path: Path | None = option(
        "--map", "TOML file that maps columns to variables or parts of a simulator.", EXISTING
    )
    window_s: float | None = option(
        "--window S",
        "With --mjcf: replay windows of this length; 0: whole runs (default: chosen and reported).",
        Quantity("s", 0.0),
    )

    @property
    def given(self) -> bool:
        """Whether it is one of FMI or MuJoCo; a map alone is one of columns."""
        return self.fmu is not None or self.mjcf is not None

    def diagnose(self, runs: Sequence[Path], **options: Any) -> Answer:
        """The answer; `options` are all else that `diagnose_mjcf` and `diagnose_unit` take."""
        assert self.map_path is not None
        with progress() as line:
            line.say("reading")
            options |= {"progress": line.say, "announced": line.note}
            if self.mjcf is not None:
                from smad.simulators.mjcf.asked import diagnose_mjcf

                return diagnose_mjcf(
                    self.mjcf, self.map_path, runs, window_s=self.window_s, **options
                )
            from smad.fmi.asked import diagnose_unit

            assert self.fmu is not None
            warn_that_code_runs(self.fmu)
            return diagnose_unit(self.fmu, self.map_path, runs, **options)

    def plan(self, inputs: Sequence[Path], within_s: float, progress: Say) -> Plan:
        """What runs with these inputs would show of it."""
        assert self.map_path is not None
        options: dict[str, Any] = {"within_s": within_s, "progress": progress}
        if self.mjcf is not None:
            from smad.simulators.mjcf.asked import plan_mjcf

            return plan_mjcf(self.mjcf, self.map_path, inputs, window_s=self.window_s, **options)
        from smad.fmi.asked import plan_unit

        assert self.fmu is not None
        warn_that_code_runs(self.fmu)
        return plan_unit(self.fmu, self.map_path, inputs, **options)


processes_option = option(
    "--processes N",
    "With --fmu or --mjcf: number of processes (default: 1; all idle cores for a slow MuJoCo "
    "model).",
    Whole(1),
)
map_option = option("--map", "Mapping file of smad log import, for tables.", EXISTING)


def mapping_of(map_path: Path | None) -> MappingFile | None:
    """Return the mapping file that --map alone names. Raises UsageError where it is none."""
    from smad.errors import LogImportError
    from smad.records.channels import read_mapping

    try:
        return None if map_path is None else read_mapping(map_path)
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
