"""What the commands of `smad gap` share: the plant, the verdict in files and on the screen."""

from __future__ import annotations

import shlex
import shutil
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import click

from smad.cli.gap_simulator import mapping_of
from smad.cli.options import option
from smad.errors import REFUSED_STATUS
from smad.view.terminal.progress import progress
from smad.view.terminal.tables import wrapped

if TYPE_CHECKING:
    from smad.diagnosis.answer import Answer
    from smad.diagnosis.report.files import AnswerFiles
    from smad.diagnosis.spring_pair import SmaPlant
    from smad.diagnosis.verdict import Verdict


variant_option = option(
    "--variant",
    "The thermal model; printed is the paper's, whose water stays cold.",
    click.Choice(["extended", "printed"]),
    default="extended",
)


@dataclass(frozen=True, kw_only=True)
class SpringPair:
    """The plant of this bench, as a command names it."""

    params: str = option("--params", "Parameter file, or A, B, conserving.", default="A")
    variant: str = variant_option

    def plant(self) -> SmaPlant:
        """Return it with its parameter set. Raises PlantError."""
        from sim_device.plant import load_parameters
        from smad.diagnosis.spring_pair import SmaPlant

        return SmaPlant(load_parameters(self.params), self.variant)

    def diagnose(
        self,
        runs: Sequence[Path],
        good: Sequence[Path],
        hold_out: Sequence[Path],
        trusted: Sequence[str] = (),
        map_path: Path | None = None,
    ) -> Answer:
        """Where it and the runs of files disagree; see `diagnose_files`."""
        from smad.diagnosis.spring_pair.files import diagnose_files

        files, mapping = (runs, good, hold_out, trusted), mapping_of(map_path)
        with progress() as line:
            return diagnose_files(self.plant(), *files, mapping=mapping, progress=line.say)


def arguments_text(
    runs: Sequence[Path],
    hold_out: Sequence[Path],
    good: Sequence[Path],
    mapping: Path | None = None,
) -> str:
    """The arguments as a shell takes them, to ask once more; a mapping is at their end."""
    words = [str(path) for path in runs]
    for name, paths in (("--hold-out", hold_out), ("--good", good)):
        words += [name, *map(str, paths)] if paths else []
    words += [] if mapping is None else ["--map", str(mapping)]
    return shlex.join(words)


def show_verdict(
    answer: Answer,
    files: AnswerFiles,
    *,
    arguments: str = "",
    facts: Sequence[tuple[str, str]] = (),
) -> None:
    """Write the files of an answer; print the verdict, what is written, and then what is not."""
    from smad.diagnosis.report.words import advice

    written, failed = files.write(answer, arguments, facts)
    # What a pipe or a terminal took is no file to read.
    readable = (p if p in written and p.is_file() else None for p in (files.verdict, files.model))
    print_verdict(answer.verdict, advice(answer.verdict, arguments, *readable) if arguments else ())
    for path in written:
        click.echo(f"written: {path}", err=True)
    for error in failed[1:]:
        click.echo(f"smad: {error}", err=True)
    if failed:
        raise failed[0]


def print_verdict(verdict: Verdict, steps: Sequence[tuple[str, str]] = ()) -> None:
    """Print the verdict as wide as the terminal, its headline first; then what to do next."""
    from smad.diagnosis.report.words import lines

    headline, *rest = lines(verdict)
    width = min(100, shutil.get_terminal_size((100, 24)).columns)
    click.secho(headline, bold=True)
    for text in rest:
        click.echo(text if text.startswith("  ") else "\n".join(wrapped(text, width)))
    for command, why in steps:
        click.echo(f"{why}: {command}" if command else why)


def require_answered(verdict: Verdict) -> None:
    """End the command with a status of its own where the verdict is that nothing is answered."""
    from smad.diagnosis.verdict import REFUSED

    if verdict.outcome == REFUSED:
        click.get_current_context().exit(REFUSED_STATUS)
