"""`smad gap investigate`: play what separates, until the cause is settled."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from smad.cli.baselines import new_plant, player, require_same, say
from smad.cli.output import axis_option, progress

if TYPE_CHECKING:
    from smad.checkup.inquiry import Report
    from smad.checkup.investigate import Proposal

_FOLDER = click.Path(file_okay=False, path_type=Path)


@click.command()
@click.option("--baseline", "folder", type=_FOLDER, required=True, help="What the bench was like.")
@click.option("--minutes", type=click.FloatRange(1.0, 600.0), default=20.0, show_default=True,
              help="Bench time for all runs with their rests.")  # fmt: skip
@click.option("--programme", "programme_folder", type=_FOLDER,
              help="Another programme than the one in the package.")  # fmt: skip
@click.option("--sim", is_flag=True, help="On a simulated bench in virtual time.")
@click.option("--effect", "effects", multiple=True, metavar="NAME[:P=V,…]",
              help="With --sim: an effect that the simulated bench has.")  # fmt: skip
@click.option("--seed", type=click.IntRange(0, 2**32 - 1), default=0, show_default=True,
              help="With --sim: of its noise.")  # fmt: skip
@axis_option
def investigate(
    *,
    folder: Path,
    minutes: float,
    programme_folder: Path | None,
    sim: bool,
    effects: tuple[str, ...],
    seed: int,
    bench: str,
) -> None:
    """Find what has changed: check up, then play again what separates best, until it is settled.

    Stops when one cause is left, the time is spent, or no run would separate what stays. Then the
    check-up is played once more as proof, and the model with the cause is written. Says at each
    step what it plays and why. Interrupted, the same command goes on. The bench is disarmed after
    each run.
    """
    from smad.checkup.inquiry import Inquiry
    from smad.checkup.series import newest_open
    from smad.checkup.store import load
    from smad.cli.baselines import chosen_programme

    if effects and not sim:
        raise click.UsageError("--effect is of a simulated bench; add --sim")
    plant = new_plant()
    baseline = load(folder, plant)
    programme = chosen_programme(programme_folder, quick=False)
    require_same(folder, baseline.bench, "simulated" if sim else bench, baseline.programme,
                 programme, part=True)  # fmt: skip
    place = newest_open(folder, "investigation", _goes_on)
    before = len(list(place.glob("*.mcap")))
    with player(sim=sim, seed=seed + 1000 + before, effects=effects, bench=bench) as play:
        inquiry = Inquiry(
            plant=plant,
            reference=baseline.reference,
            programme=programme,
            originals=folder / "good-1",
            folder=place,
            play=play,
            say=say,
            seconds=60.0 * minutes,
        )
        with progress() as line:
            report = inquiry.carry_out(line.say)
    _print(report, place, inquiry.spent_s(report))


def _goes_on(folder: Path) -> bool:
    """Whether an investigation was begun and has not come to its end."""
    from smad.checkup.inquiry import read_report

    report = folder / "investigation.json"
    return report.exists() and not read_report(report).why_over


def _print(report: Report, folder: Path, spent_s: float) -> None:
    from smad.cli.baselines import print_verdict
    from smad.diagnosis.report.words import budget_lines
    from smad.diagnosis.verdict import CHECK_UP

    assert report.verdict is not None
    print_verdict(report.verdict)
    click.echo(f"{report.why_over}; {len(report.records)} runs in {spent_s / 60.0:.1f} min")
    for run, separation in report.offers.items():
        click.echo(
            f"the baseline lacks {run}: commissioned on the good bench, it might separate them by "
            f"d² = {separation:.0f}"
        )
    if report.proof:
        click.echo("held out, with the model from the runs before:")
        for text in budget_lines(report.proof, CHECK_UP):
            click.echo(text)
    if report.model:
        click.echo(f"model: {report.model}")
    click.echo(f"runs and report: {folder}")


def proposal(folder: Path, now: Path | None) -> Proposal:
    """What an investigation would play next, from the newest check-up or investigation."""
    from smad.checkup.errors import BaselineError
    from smad.checkup.files import read_folder
    from smad.checkup.investigate import propose
    from smad.checkup.judge import judged
    from smad.checkup.store import load

    plant = new_plant()
    reference = load(folder, plant).reference
    answers = (*folder.glob("now-*"), *folder.glob("investigation-*"))
    places = sorted((p for p in answers if any(p.glob("*.mcap"))), key=lambda p: p.stat().st_mtime)
    if now is None and not places:
        raise BaselineError(
            f"{folder} holds no check-up yet", action="make one with smad gap checkup --baseline"
        )
    known = {r.name for r in reference.runs}
    # An investigation numbers its runs: 01-run-1, 02-run-2, 03-run-1.
    named = [(f.run, f.name.lstrip("0123456789-") if f.name not in known else f.name)
             for f in read_folder(now or places[-1])]  # fmt: skip
    runs = [(run, name) for run, name in named if name in known]
    with progress() as line:
        found = judged(plant, reference, runs, progress=line.say)
    click.secho(found.verdict.headline, bold=True)
    return propose(found, dict.fromkeys(known, 1.0), left_s=1.0)
