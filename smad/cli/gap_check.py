"""`smad gap check`: verdicts on a bank of recorded runs whose causes smad was not told."""

from __future__ import annotations

import time
from pathlib import Path
from typing import TYPE_CHECKING

import click

from smad.cli.output import bad

if TYPE_CHECKING:
    from smad.diagnosis.bank import Check, Judged, VerdictFile

_OUT = click.Path(dir_okay=False, path_type=Path)
_FOLDER = click.Path(file_okay=False, path_type=Path)


@click.command()
@click.argument("bank", type=_FOLDER, metavar="BANK_FOLDER")
@click.option("--cases", type=click.IntRange(min=1), help="Only so many, spread over the bank.")
@click.option("--only", default="", help="Only these cases, with commas between them.")
@click.option("--out", type=_OUT, help="The verdict file  [default: BANK_FOLDER-verdicts.json]")
@click.option("--jobs", type=click.IntRange(1, 256), default=2, show_default=True,
              help="Cases at the same time, each in a process of one thread.")  # fmt: skip
@click.option("--effects", default="", help="Only these of the library, with commas between.")
@click.option("--params", default="A", show_default=True,
              help="Parameter file, or A, B, conserving.")  # fmt: skip
@click.option("--variant", type=click.Choice(["extended", "printed"]), default="extended",
              show_default=True, help="The thermal model.")  # fmt: skip
@click.option("--seed", type=click.IntRange(0, 2**32 - 1), default=0, show_default=True,
              help="Of the spread of --cases.")  # fmt: skip
def check(
    *,
    bank: Path,
    cases: int | None,
    only: str,
    out: Path | None,
    jobs: int,
    effects: str,
    params: str,
    variant: str,
    seed: int,
) -> int:
    """Diagnose every case of a bank of recorded runs, and write the verdicts to a file.

    An interrupted check goes on where it stopped when the same command is given again.
    """
    from smad.diagnosis.bank import Check, answered, begun, chosen, read_manifest
    from smad.diagnosis.diagnose import library

    manifest = read_manifest(bank)
    order = Check(
        folder=bank, manifest=manifest, params=params, variant=variant,
        cases=chosen(manifest, count=cases, only=_listed(only), seed=seed),
        effects=tuple(_listed(effects)) or None,
    )  # fmt: skip
    library(order.plant, order.effects)
    path = out or bank.with_name(f"{bank.resolve().name}-verdicts.json")
    before = begun(order, path)
    _announce(order, before, jobs)
    try:
        file = answered(order, before, path, jobs=jobs, report=_Progress(order, before))
    except KeyboardInterrupt:
        click.echo(f"finished cases are kept in {path}; the same command goes on", err=True)
        raise
    without = [c.id for c in order.cases if c.id not in file.verdicts]
    click.echo(f"{len(order.cases) - len(without)} of {len(order.cases)} cases judged: {path}")
    for case in without[:5]:
        click.echo(f"{case}: {file.notes[case]}", err=True)
    if without:
        more = f" and {len(without) - 5} more" if len(without) > 5 else ""
        names = ", ".join(without[:5])
        click.echo(f"without verdict: {names}{more}; the same command tries them again", err=True)
    return 1 if without else 0


def _listed(text: str) -> list[str]:
    return [name.strip() for name in text.split(",") if name.strip()]


def _announce(order: Check, before: VerdictFile, jobs: int) -> None:
    known = sum(c.id in before.verdicts for c in order.cases)
    kept = f", {known} of them judged before" if known else ""
    click.echo(
        f"bank {order.manifest.bank}: {len(order.cases)} of {len(order.manifest.cases)} "
        f"cases{kept}, {jobs} at a time",
        err=True,
    )


class _Progress:
    """Tells what became of each case, and about how long the others take."""

    def __init__(self, order: Check, before: VerdictFile) -> None:
        self._total, self._began_s = len(order.cases), time.monotonic()
        self._todo = sum(c.id not in before.verdicts for c in order.cases)

    def __call__(self, judged: Judged, left: int) -> None:
        said, verdict = bad(f"failed: {judged.error}"), judged.verdict
        if verdict is not None:
            places = ", ".join(p.place for p in verdict.places)
            said = f"{verdict.outcome}: {places}" if places else verdict.outcome
        spent_s = time.monotonic() - self._began_s
        left_s = left * spent_s / (self._todo - left)
        click.echo(
            f"{judged.case}  {said}  {judged.cpu_s:.0f} s  "
            f"[{self._total - left}/{self._total}, {_clock(left_s)} left]",
            err=True,
        )


def _clock(seconds: float) -> str:
    minutes = round(seconds / 60.0)
    return f"{minutes // 60} h {minutes % 60:02d} min" if minutes >= 60 else f"{minutes} min"
