"""`smad gap`: where simulator and bench disagree, because of what, and how much of it goes."""

from pathlib import Path

import click

from firmware_protocol.nearest import instead
from smad.cli import complete
from smad.cli.gap_checkup import checkup, commission, investigate
from smad.cli.gap_next import next_experiment
from smad.cli.gap_plan import plan_runs
from smad.cli.gap_print import (
    SpringPair,
    arguments_text,
    require_answered,
    show_verdict,
    variant_option,
)
from smad.cli.gap_runs import (
    ManyRuns,
    good_option,
    hold_out_option,
    leave_out_option,
    require_among,
    runs_argument,
    trust_option,
    without_cut_runs,
    without_left_out,
)
from smad.cli.gap_simulator import Simulator, map_option, mapping_of, processes_option
from smad.cli.options import EXISTING, OUTPUT, Group, argument, json_option, option, together
from smad.cli.output import print_json
from smad.cli.quantity import Whole
from smad.files import write_named
from smad.view.terminal.progress import progress


@click.group(cls=Group)
def gap() -> None:
    """Diagnose the gap between the simulator and recorded runs."""


for _command in (commission, checkup, investigate, next_experiment, plan_runs):
    gap.add_command(_command)


@gap.command(cls=ManyRuns)
def diagnose(
    *,
    runs: tuple[Path, ...] = runs_argument,
    hold_out: tuple[Path, ...] = hold_out_option,
    good: tuple[Path, ...] = good_option,
    leave_out: tuple[str, ...] = leave_out_option,
    trust: tuple[str, ...] = trust_option,
    pair: SpringPair = together(SpringPair),
    json_path: Path | None = option("--json", "Write the whole verdict here.", OUTPUT),
    page_path: Path | None = option("--report", "Write a page with figures here.", OUTPUT),
    model_path: Path | None = option("--apply", "Write the better model here.", OUTPUT),
    simulator: Simulator = together(Simulator),
    processes: int | None = processes_option,
) -> None:
    """Say where model and RUNs disagree, and what is missing.

    It names an effect or a law, and the gap that remains with it.

    With --good it says what has changed since those runs; without, what differs between model and
    bench. Without --hold-out each run is used to judge models fitted to the others.

    A RUN is a run log, a table, a folder of them, or a quoted pattern. Without --fmu and --mjcf,
    --map is a mapping file of smad log import. Give RUNs before --hold-out and --good, which take
    all that follows. The exit status is 3 if the runs cannot answer the question.
    """
    from smad.diagnosis.report.files import AnswerFiles

    require_among(trust, (runs, hold_out, good), "--trust")
    runs, hold_out, good = without_left_out((runs, hold_out, good), leave_out)
    if not runs:
        raise click.UsageError("--leave-out leaves no run to fit; give more runs")
    good = without_cut_runs(good)
    if simulator.given:
        answer = simulator.diagnose(
            runs, good=good, hold_out=hold_out, trusted=trust, processes=processes
        )
        arguments = ""
    else:
        answer = pair.diagnose(runs, good, hold_out, trust, simulator.map_path)
        # Of a plant that is not ours, no command but this one is known.
        arguments = arguments_text(runs, hold_out, good, simulator.map_path)
    verdict = answer.verdict
    # A refused answer has no model; why it was refused says more than that.
    model_path = None if verdict.outcome == "refused" and not verdict.models else model_path
    files = AnswerFiles(verdict=json_path, page=page_path, model=model_path)
    show_verdict(answer, files, arguments=arguments)
    require_answered(verdict)


@gap.command()
def apply(
    *,
    verdict: Path = argument(EXISTING),
    out: Path = option("--out", "The model file to write.", OUTPUT, required=True),
    first: int | None = option("--first", "Only so many causes; 0: parameters alone.", Whole(0)),
) -> None:
    """Write the model of a VERDICT, with all or some causes.

    A verdict is what --json of `smad gap diagnose` and `smad gap checkup` writes.
    """
    from smad.diagnosis.verdict import read_verdict

    read = read_verdict(verdict)
    write_named(out, read.model_text(first, as_json=out.suffix == ".json"))
    causes = (f", {cause.name or cause.words}" for cause in read.causes[:first])
    click.echo(f"{out}: parameters{''.join(causes)}")


@gap.command()
def effects(
    *,
    names: tuple[str, ...] = argument(
        nargs=-1, metavar="[NAME]...", shell_complete=complete.effects
    ),
    variant: str = variant_option,
    as_json: bool = json_option,
) -> None:
    """List the effects of the library, or explain NAME."""
    from smad.diagnosis.report.words import library_lines
    from smad.diagnosis.spring_pair import SmaPlant

    library = SmaPlant(variant=variant).effects
    library_names = [e.name for e in library]
    for name in names:
        if name not in library_names:
            suggestion = instead(name, library_names, "smad gap effects lists them")
            raise click.BadParameter(f"there is no effect {name!r}; {suggestion}")
    library = [e for e in library if not names or e.name in names]
    if as_json:
        print_json(list(library))
        return
    click.echo("\n".join(line for effect in library for line in library_lines(effect)))


@gap.command()
def verify(
    *,
    runs: tuple[Path, ...] = runs_argument,
    model_path: Path = option("--model", "Model file that --apply wrote.", EXISTING, required=True),
    map_path: Path | None = map_option,
    pair: SpringPair = together(SpringPair),
    as_json: bool = json_option,
) -> None:
    """Show the gap of new RUNs with and without the model."""
    from smad.diagnosis.report.words import findings_to, verified_lines, verified_records
    from smad.diagnosis.spring_pair.signals import read_gap_runs
    from smad.diagnosis.verify import verified

    plant = pair.plant()
    model = plant.load_model(model_path)
    with progress() as line:
        read = read_gap_runs(runs, runs, mapping=mapping_of(map_path), progress=line.say)
        rows = verified(plant, read, model, found=findings_to(line.note), progress=line.say)
    if as_json:
        print_json(verified_records(rows))
    else:
        click.echo("\n".join(verified_lines(rows)))
