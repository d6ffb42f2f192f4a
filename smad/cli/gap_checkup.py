"""`smad gap commission`, `checkup` and `investigate`: the bench as its own control."""

from __future__ import annotations

import contextlib
import shlex
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from smad.cli.gap_print import print_verdict, show_verdict
from smad.cli.options import FOLDER, OUTPUT, Command, axis_option, flag, option, together
from smad.cli.output import ready_client
from smad.cli.quantity import Quantity, Whole
from smad.cli.simulated import effect_option, seed_option, sim_option, simulated_model
from smad.view.terminal.progress import Progress, progress

if TYPE_CHECKING:
    from smad.checkup.series import Player


@dataclass(frozen=True, kw_only=True)
class _Bench:
    """What plays the runs of a programme: a simulated bench, or that of the running daemon."""

    sim: bool = sim_option
    seed: int = seed_option
    programme_folder: Path | None = option(
        "--programme", "With --baseline: a programme in place of the package's.", FOLDER
    )
    bench: str = axis_option

    @property
    def name(self) -> str:
        """What a baseline of it says it is of."""
        return "simulated" if self.sim else self.bench

    @contextlib.contextmanager
    def player(self, line: Progress, effects: Sequence[str] = ()) -> Iterator[Player]:
        """Plays runs for as long as the block lasts; that of a daemon is ready to arm."""
        from smad.checkup.play import live, simulated

        if self.sim:
            with simulated(simulated_model(effects), seed=self.seed) as player:
                yield player
            return
        with ready_client(self.bench, extra="gap") as connected:
            yield live(connected, bench=self.bench, say=line.note, progress=line.say)


@click.command(cls=Command)
def commission(
    *,
    folder: Path = option("--baseline", "Where the baseline goes.", FOLDER, required=True),
    repeats: int = option(
        "--repeats", "How often the whole programme is played.", Whole(1, 8), default=2
    ),
    again: bool = flag("--again", "Add repeats to a baseline, for a better floor."),
    quick: bool = flag("--quick", "Play only the runs that separate most effects."),
    bench: _Bench = together(_Bench),
) -> None:
    """Record the programme on a good bench, as a baseline.

    It arms the bench and heats it. Runs are kept in FOLDER/good-1, good-2 …; repeat an interrupted
    command, and it continues after the last finished run. A baseline that cannot be read, or is
    from another version of smad, is recomputed from its runs.
    """
    from smad.checkup import baseline as baselines
    from smad.checkup.programme import chosen
    from smad.diagnosis.spring_pair import SmaPlant

    programme = chosen(bench.programme_folder, quick=quick)
    with progress() as line:
        reference = baselines.commission(
            folder,
            SmaPlant(),
            programme,
            bench.player(line),
            bench=bench.name,
            repeats=repeats,
            again=again,
            say=line.note,
            progress=line.say,
        )
    click.echo(baselines.in_words(folder, programme, reference))
    if reference.repeats < 2:
        click.echo(
            "one repeat cannot show how much repeats differ; add another with --again", err=True
        )


def _require_pairs(options: Mapping[str, Any]) -> None:
    if (options["folder"] is None) == (options["good"] is None):
        raise click.UsageError("give --baseline FOLDER of smad gap commission, or --good and --now")
    if options["good"] is not None and options["now"] is None:
        raise click.UsageError("--good needs --now: the runs to judge")


@click.command(cls=Command, require=_require_pairs)
def checkup(
    *,
    folder: Path | None = option(
        "--baseline", "Play the programme of this baseline again, and judge.", FOLDER
    ),
    good: Path | None = option(
        "--good", "Run files of the good bench, preferably with repeats.", FOLDER
    ),
    now: Path | None = option(
        "--now", "New run files with the same inputs as the good ones.", FOLDER
    ),
    quick: bool = flag("--quick", "With --baseline: only the runs that separate most effects."),
    out: Path | None = option(
        "--out",
        "With --baseline, without --now: their folder  [default: BASELINE/now-1, now-2 …]",
        FOLDER,
    ),
    effects: tuple[str, ...] = effect_option,
    bench: _Bench = together(_Bench),
    json_path: Path | None = option("--json", "Write the verdict here.", OUTPUT),
    page_path: Path | None = option("--report", "Write a page with figures here.", OUTPUT),
    model_path: Path | None = option(
        "--apply", "Write the model with the effects and laws that were found.", OUTPUT
    ),
) -> None:
    """Repeat the inputs of good runs; say what has changed.

    With --baseline it plays the programme, or reads its runs from --now, and compares with the
    baseline. With --good and --now it compares run files: run logs, CSV or Parquet with units in
    their columns' names. It pairs runs by their inputs, and by name if several match.
    It lists and leaves out good runs that a stop cut short.
    """
    from smad.checkup import check
    from smad.checkup.programme import chosen
    from smad.diagnosis.report.files import AnswerFiles
    from smad.diagnosis.spring_pair import SmaPlant

    plant = SmaPlant()
    with progress() as line:
        if good is not None and now is not None:
            judgement = check.check_files(plant, good, now, say=line.note, progress=line.say)
        else:
            assert folder is not None
            judgement = check.check_baseline(
                folder,
                plant,
                chosen(bench.programme_folder, quick=quick),
                now,
                bench.player(line, effects),
                out=out,
                bench=bench.name,
                say=line.note,
                progress=line.say,
            )
    facts = [("baseline", str(folder or good)), ("repeats", str(judgement.pairs.good.repeats))]
    files = AnswerFiles(verdict=json_path, page=page_path, model=model_path)
    again = shlex.join(["--baseline", str(folder)]) if folder else ""
    show_verdict(judgement, files, arguments=again, facts=facts)


@click.command(cls=Command)
def investigate(
    *,
    folder: Path = option(
        "--baseline", "The baseline from smad gap commission.", FOLDER, required=True
    ),
    minutes: float = option(
        "--minutes",
        "Bench time for all runs with their rests.",
        Quantity("min", 1.0, 600.0),
        default=20.0,
    ),
    effects: tuple[str, ...] = effect_option,
    bench: _Bench = together(_Bench),
) -> None:
    """Check up, then measure more until one cause is left.

    It plays the quick runs, then the run that best separates the remaining rivals, each run once.
    It stops when one cause is left, the time is spent, or no other run would separate the rest.
    Then it plays the quick runs once more, as proof, and writes the model with the cause. It says
    at each step what it plays and why. After an interruption, repeat the command to continue. The
    bench is disarmed after each run.
    """
    from smad.checkup import investigation
    from smad.checkup.programme import chosen
    from smad.diagnosis.report.words import budget_lines
    from smad.diagnosis.spring_pair import SmaPlant
    from smad.diagnosis.verdict import PAIRED

    with progress() as line:
        place, report = investigation.investigate(
            folder,
            SmaPlant(),
            chosen(bench.programme_folder),
            bench.player(line, effects),
            bench=bench.name,
            seconds=60.0 * minutes,
            say=line.note,
            progress=line.say,
        )
    assert report.verdict is not None
    print_verdict(report.verdict)
    click.echo("\n".join(report.ending_lines()))
    if report.proof:
        click.echo("held out, with the model from the runs before:")
        click.echo("\n".join(budget_lines(report.proof, PAIRED)))
    if report.model:
        click.echo(f"model: {report.model}")
    click.echo(f"runs and report: {place}")
