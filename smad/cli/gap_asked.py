"""What the commands of `smad gap` share: the plant, its runs, and the diagnosis itself."""

from __future__ import annotations

import contextlib
import dataclasses
import shlex
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import click

from smad.cli.baselines import print_verdict
from smad.cli.output import progress
from smad.errors import REFUSED_STATUS

if TYPE_CHECKING:
    from smad.diagnosis.answer import Answer
    from smad.diagnosis.runs import GapRun
    from smad.diagnosis.spring_pair import SmaPlant
    from smad.diagnosis.verdict import Verdict


params_option = click.option(
    "--params", default="A", show_default=True, help="Parameter file, or A, B, conserving."
)
variant_option = click.option(
    "--variant",
    type=click.Choice(["extended", "printed"]),
    default="extended",
    show_default=True,
    help="The thermal model; printed is the paper's, whose water stays cold.",
)


def plant_of(params: str, variant: str) -> SmaPlant:
    from sim_device.plant import load_parameters
    from smad.diagnosis.spring_pair import SmaPlant

    with clean_errors():
        return SmaPlant(load_parameters(params), variant)


@contextlib.contextmanager
def clean_errors() -> Iterator[None]:
    """Errors of the plant become one line, as all others."""
    from sim_device.plant.errors import PlantError
    from smad.diagnosis.errors import GapError

    try:
        yield
    except PlantError as error:
        raise GapError(str(error)) from error


def read_runs(
    paths: Sequence[Path], among: Sequence[Path], trusted: Sequence[str] = ()
) -> list[GapRun]:
    """The runs of files, named apart; `trusted`: names or paths of those that are."""
    from smad.cli.gap_runs import words_of
    from smad.diagnosis.spring_pair.signals import read_gap_run
    from smad.runlog.bounds import Together

    together = Together()
    runs = [read_gap_run(path, together) for path in paths]
    return [
        dataclasses.replace(
            run,
            name=unlike(path, among) or run.name,
            trusted=bool(words_of(path) & set(trusted)),
        )
        for run, path in zip(runs, paths, strict=True)
    ]


def unlike(path: Path, paths: Sequence[Path]) -> str:
    """A name with as much of the folder as tells two files of one name apart; empty: no need."""
    alike = [p for p in paths if p != path and p.name == path.name]
    parts = path.absolute().parts
    for k in range(2, len(parts) + 1):
        if not any(p.absolute().parts[-k:] == parts[-k:] for p in alike):
            return "/".join((*parts[-k:-1], path.stem)) if alike else ""
    return ""


def diagnosed(
    plant: SmaPlant,
    runs: Sequence[Path],
    good: Sequence[Path],
    hold_out: Sequence[Path],
    trusted: Sequence[str] = (),
) -> Answer:
    import msgspec

    from smad.checkup.commission import repeated
    from smad.checkup.files import Found
    from smad.diagnosis import diagnose
    from smad.diagnosis.spring_pair.signals import usable

    with progress() as line:
        say: Callable[[str], None] = line.say
        say("reading")
        everything = (*runs, *good, *hold_out)
        asked, known, held = (
            read_runs(some, everything, trusted) for some in (runs, good, hold_out)
        )
        found = diagnose(asked, plant=plant, good=known, hold_out=held, progress=say)
        now, then = (
            [Found.of(path, run) for path, raw in zip(paths, read, strict=True)
             if (run := usable(raw)) is not None]
            for paths, read in (((*runs, *hold_out), (*asked, *held)), (good, known))
        )  # fmt: skip
        verdict = msgspec.structs.replace(found.verdict, repeated=repeated(plant, then, now, say))
        return dataclasses.replace(found, verdict=verdict)


def asked_words(runs: Sequence[Path], hold_out: Sequence[Path], good: Sequence[Path]) -> str:
    """The arguments as a shell takes them, to ask once more."""
    words = [str(path) for path in runs]
    for option, paths in (("--hold-out", hold_out), ("--good", good)):
        words += [option, *map(str, paths)] if paths else []
    return shlex.join(words)


def print_answer(verdict: Verdict, asked: str) -> None:
    """Print the verdict, what was noted of its runs, and what to do next."""
    from smad.diagnosis.report.words import advice

    print_verdict(verdict)
    for text in noted(verdict):
        click.echo(text)
    for command, why in advice(verdict, asked) if asked else ():
        click.echo(f"{why}: {command}" if command else why)


def noted(verdict: Verdict) -> list[str]:
    """What was left out of runs that are used, or is doubtful in them; one line for a text."""
    runs: dict[str, list[str]] = {}
    for f in verdict.findings:
        if not f.refuses and f.run != "all runs":
            runs.setdefault(f.text, []).append(f.run)
    return [f"{', '.join(names)}: {text}" for text, names in runs.items()]


def require_answered(verdict: Verdict) -> None:
    """End the command with a status of its own where the verdict is that nothing is answered."""
    from smad.diagnosis.verdict import REFUSED

    if verdict.outcome == REFUSED:
        click.get_current_context().exit(REFUSED_STATUS)
