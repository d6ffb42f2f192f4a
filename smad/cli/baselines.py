"""What the commands about baselines share: programme, bench, and how a verdict is printed."""

from __future__ import annotations

import shutil
from collections.abc import Sequence
from contextlib import AbstractContextManager
from pathlib import Path
from typing import TYPE_CHECKING

import click

if TYPE_CHECKING:
    from smad.checkup.programme import Programme
    from smad.checkup.series import Play
    from smad.diagnosis.spring_pair import SmaPlant
    from smad.diagnosis.verdict import Verdict


def require_same(
    folder: Path, bench: str, whose: str, digest: str, programme: Programme, *, part: bool = False
) -> None:
    """Refuses a baseline of another bench or programme; `part`: some of its runs suffice."""
    from smad.checkup.errors import BaselineError
    from smad.checkup.programme import shipped

    if bench != whose:
        raise BaselineError(
            f"the baseline {folder} is of another bench",
            value=bench,
            limit=whose,
            action="give the baseline of this bench",
        )
    allowed = {programme.digest}
    if part:
        allowed |= {shipped().digest, shipped().quick().digest}
    if digest not in allowed:
        raise BaselineError(
            f"the baseline {folder} is of another programme",
            value=digest[:12],
            limit=programme.digest[:12],
            action=other_part(digest)
            or "give with --programme the one it was recorded with, or commission again",
        )


def other_part(digest: str) -> str:
    """What to do with runs of a part of the shipped programme; empty for those of another one."""
    from smad.checkup.programme import shipped

    if digest == shipped().quick().digest:
        return "add --quick: it holds the quick part only"
    return "leave --quick out: it holds the whole programme" if digest == shipped().digest else ""


def new_plant() -> SmaPlant:
    from smad.diagnosis.spring_pair import SmaPlant

    return SmaPlant()


def chosen_programme(folder: Path | None, quick: bool) -> Programme:
    from smad.checkup.programme import read_programme, shipped

    programme = shipped() if folder is None else read_programme(folder)
    return programme.quick() if quick else programme


def player(
    *, sim: bool, seed: int, effects: Sequence[str], bench: str
) -> AbstractContextManager[Play]:
    from smad.cli.benches import live, simulated

    if sim:
        return simulated(seed=seed, effects=effects)
    return live(bench, who="smad gap")


def say(text: str) -> None:
    click.echo(text, err=True)


def print_verdict(verdict: Verdict) -> None:
    from smad.diagnosis.report.words import lines

    headline, *rest = lines(verdict)
    width = min(100, shutil.get_terminal_size((100, 24)).columns)
    click.secho(headline, bold=True)
    for text in rest:
        click.echo(text if text.startswith("  ") else click.wrap_text(text, width=width))
