"""`smad gap check`: verdicts on a bank of recorded runs whose causes smad was not told."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from smad.cli.output import bad

if TYPE_CHECKING:
    from smad.diagnosis.bank.running import Order, Progress
    from smad.diagnosis.bank.verdicts import VerdictFile
    from smad.diagnosis.verdict import Verdict

_OUT = click.Path(dir_okay=False, path_type=Path)
_FOLDER = click.Path(file_okay=False, path_type=Path)
_FILE = click.Path(dir_okay=False, path_type=Path)


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
    from smad.diagnosis.bank.bank import chosen, open_bank, require_files
    from smad.diagnosis.bank.case import How
    from smad.diagnosis.bank.running import Order
    from smad.diagnosis.bank.running import check as run
    from smad.diagnosis.bank.verdicts import write_verdicts

    opened = open_bank(bank)
    taken = chosen(opened, count=cases, only=_listed(only), seed=seed)
    require_files(opened, taken)
    path = out or bank.with_name(f"{bank.resolve().name}-verdicts.json")
    how = How(params, variant, tuple(_listed(effects)) or None)
    how.require()
    order = Order(opened, taken, how, path.with_name(path.name + ".parts"))
    _announce(order, f"{jobs} at a time")
    try:
        file = run(order, jobs=jobs, report=_tell)
    except KeyboardInterrupt:
        click.echo(f"finished cases are kept in {order.folder}; the same command goes on", err=True)
        raise
    write_verdicts(path, file)
    click.echo(f"{len(file.verdicts)} of {len(taken)} cases judged: {path}")
    return _failed(order, file)


def _listed(text: str) -> list[str]:
    return [name.strip() for name in text.split(",") if name.strip()]


def _announce(order: Order, where: str) -> None:
    known = len(order.finished())
    kept = f", {known} of them judged before" if known else ""
    click.echo(
        f"bank {order.bank.manifest.bank}: {len(order.cases)} of "
        f"{len(order.bank.manifest.cases)} cases{kept}, {where}",
        err=True,
    )


def _tell(progress: Progress) -> None:
    part = progress.part
    said = bad(f"failed: {part.error}") if part.verdict is None else _in_short(part.verdict)
    left = _clock(progress.left_s)
    click.echo(
        f"{part.case}  {said}  {part.seconds:.0f} s  "
        f"[{progress.done}/{progress.total}, {left} left]",
        err=True,
    )


def _in_short(verdict: Verdict) -> str:
    if not verdict.places:
        return verdict.outcome
    return f"{verdict.outcome}: {', '.join(p.place for p in verdict.places)}"


def _clock(seconds: float) -> str:
    minutes = round(seconds / 60.0)
    return f"{minutes // 60} h {minutes % 60:02d} min" if minutes >= 60 else f"{minutes} min"


def _failed(order: Order, file: VerdictFile) -> int:
    without = [c.id for c in order.cases if c.id not in file.verdicts]
    if not without:
        return 0
    for case in without[:5]:
        click.echo(f"{case}: {file.notes[case]}", err=True)
    more = f" and {len(without) - 5} more" if len(without) > 5 else ""
    click.echo(
        f"without verdict: {', '.join(without[:5])}{more}; the same command tries them again",
        err=True,
    )
    return 1
