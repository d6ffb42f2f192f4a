"""`smad gap check` and `smad gap score`: is the diagnosis right on data it was not told about?"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from smad.cli.output import bad

if TYPE_CHECKING:
    from smad.diagnosis.bank.running import Order, Progress
    from smad.diagnosis.bank.verdicts import CaseVerdict, VerdictFile

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
@click.option("--leave-out/--no-leave-out", default=False, show_default=True,
              help="Judge once more without the first cause in the library.")  # fmt: skip
@click.option("--keep", type=_FOLDER, help="Write each whole diagnosis into this folder.")
@click.option("--effects", default="", help="Only these of the library, with commas between.")
@click.option("--params", default="A", show_default=True,
              help="Parameter file, or A, B, conserving.")  # fmt: skip
@click.option("--variant", type=click.Choice(["extended", "printed"]), default="extended",
              show_default=True, help="The thermal model.")  # fmt: skip
@click.option("--seed", type=click.IntRange(0, 2**32 - 1), default=0, show_default=True,
              help="Of the diagnosis, and of the spread of --cases.")  # fmt: skip
def check(
    *,
    bank: Path,
    cases: int | None,
    only: str,
    out: Path | None,
    jobs: int,
    leave_out: bool,
    keep: Path | None,
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
    from smad.gap.settings import Settings

    opened = open_bank(bank)
    taken = chosen(opened, count=cases, only=_listed(only), seed=seed)
    require_files(opened, taken)
    path = out or bank.with_name(f"{bank.resolve().name}-verdicts.json")
    how = How(params, variant, Settings(seed=seed), leave_out, tuple(_listed(effects)) or None)
    how.require()
    order = Order(opened, taken, how, path.with_name(path.name + ".parts"), keep)
    if keep is not None:
        keep.mkdir(parents=True, exist_ok=True)
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


def _in_short(verdict: CaseVerdict) -> str:
    if not verdict.causes:
        return verdict.outcome
    first = verdict.causes[0]
    names = " or ".join(verdict.group) if verdict.group else " + ".join(first.names)
    return f"{verdict.outcome}: {names} ({first.probability:.2f})"


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


@click.command()
@click.argument("verdicts", type=_FILE)
@click.argument("key", type=_FILE)
@click.option("--json", "json_path", type=_OUT, help="Write all scores here.")
@click.option(
    "--answered-only", is_flag=True, help="Leave out cases without a verdict, after --cases."
)
def score(*, verdicts: Path, key: Path, json_path: Path | None, answered_only: bool) -> None:
    """Compare VERDICTS with the KEY of their bank."""
    from smad.diagnosis.bank.errors import KeyMismatchError
    from smad.diagnosis.bank.key import SEALED, read_key
    from smad.diagnosis.bank.score import matched, scores, text, write_scores
    from smad.diagnosis.bank.verdicts import read_verdicts

    file = read_verdicts(verdicts)
    truth, key_sha256 = read_key(key)
    if truth.bank == SEALED:
        raise KeyMismatchError(
            "this key is sealed, and its use is logged",
            value=str(key),
            action="use python -m evaluation score, in a checkout",
        )
    result = scores(matched(file, truth, key_sha256, answered_only=answered_only), truth.bank)
    click.echo(text(result))
    if json_path is not None:
        write_scores(json_path, result)
        click.echo(f"written: {json_path}", err=True)
