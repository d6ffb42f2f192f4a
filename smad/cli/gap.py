"""`smad gap`: where simulator and bench disagree, because of what, and how much of it goes."""

from __future__ import annotations

import contextlib
import dataclasses
import shlex
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import click

from smad.cli import complete
from smad.cli.baselines import print_verdict
from smad.cli.gap_check import check
from smad.cli.gap_checkup import checkup, commission
from smad.cli.gap_investigate import investigate
from smad.cli.gap_runs import (
    ManyRuns,
    good_option,
    hold_out_option,
    leave_out_option,
    remaining,
    runs_argument,
    some_runs_argument,
    uncut,
)
from smad.cli.output import bench_option, progress

if TYPE_CHECKING:
    from smad.diagnosis.answer import Answer
    from smad.diagnosis.plant import ModelPoint
    from smad.diagnosis.runs import GapRun
    from smad.diagnosis.spring_pair import SmaPlant
    from smad.diagnosis.verdict import Verdict

_RUN = click.Path(exists=True, dir_okay=False, path_type=Path)
_OUT = click.Path(dir_okay=False, path_type=Path)
_OFFERS = 4

_params = click.option(
    "--params", default="A", show_default=True, help="Parameter file, or A, B, conserving."
)
_variant = click.option(
    "--variant",
    type=click.Choice(["extended", "printed"]),
    default="extended",
    show_default=True,
    help="The thermal model; printed is the paper's, whose water stays cold.",
)
_seed = click.option("--seed", type=click.IntRange(0, 2**32 - 1), default=0, show_default=True)


@click.group()
def gap() -> None:
    """Diagnose the gap between the simulator and recorded runs."""


gap.add_command(check)
gap.add_command(commission)
gap.add_command(checkup)
gap.add_command(investigate)


@gap.command(cls=ManyRuns)
@runs_argument
@hold_out_option
@good_option
@leave_out_option
@_params
@_variant
@click.option("--json", "json_path", type=_OUT, help="Write the whole verdict here.")
@click.option("--html", "html_path", type=_OUT, help="Write the report page here.")
@click.option("--apply", "model_path", type=_OUT,
              help="Write the model with everything that is told here.")  # fmt: skip
@click.option("--fmu", type=_RUN, help="The model is this unit of FMI 2.0; needs --map.")
@click.option("--map", "map_path", type=_RUN, help="With --fmu: what its variables are (TOML).")
def diagnose(
    *,
    runs: tuple[Path, ...],
    hold_out: tuple[Path, ...],
    good: tuple[Path, ...],
    leave_out: tuple[str, ...],
    params: str,
    variant: str,
    json_path: Path | None,
    html_path: Path | None,
    model_path: Path | None,
    fmu: Path | None,
    map_path: Path | None,
) -> None:
    """Say where model and RUNs disagree, which law is missing there, and how much of the gap goes.

    With --good the question is what has changed since those runs; without, every difference between
    model and bench counts. Without --hold-out each run is judged by a model of the others.

    A RUN is a run log, a folder of them, or a quoted pattern. Give RUNs before --hold-out and
    --good, which take all that follows.
    """
    runs, hold_out, good = remaining((runs, hold_out, good), leave_out)
    if not runs:
        raise click.UsageError("--leave-out leaves no run to fit; give more runs")
    good = uncut(good)
    if (fmu is None) != (map_path is None):
        raise click.UsageError("--fmu and --map belong together; give both")
    if fmu is not None and model_path is not None:
        raise click.UsageError("--apply writes a model of the spring pair; leave it out with --fmu")
    with _clean_errors():
        if fmu is not None and map_path is not None:
            from smad.fmi.asked import diagnose_unit

            with progress() as line:
                answer = diagnose_unit(
                    fmu, map_path, runs, good=good, hold_out=hold_out, progress=line.say
                )
            asked = ""
        else:
            answer = _diagnosed(_plant(params, variant), runs, good, hold_out)
            # Of a plant that is not ours, no command but this one is known.
            asked = _asked(runs, hold_out, good)
        _print_verdict(answer.verdict, asked)
        if json_path is not None:
            json_path.write_bytes(answer.verdict.to_json())
        if html_path is not None:
            from smad.diagnosis.report.page import page_of
            from smad.report.page import write_page

            write_page(page_of(answer, asked), html_path)
        if model_path is not None:
            from smad.diagnosis.model_file import apply as write

            write(answer.verdict, model_path)
    for path in (json_path, html_path, model_path):
        if path is not None:
            click.echo(f"written: {path}", err=True)


@gap.command()
@click.argument("verdict", type=_RUN)
@click.option("--out", type=_OUT, required=True, help="The model file to write.")
@click.option("--first", type=click.IntRange(0),
              help="Only the first places of the list; 0: the parameters alone.")  # fmt: skip
def apply(*, verdict: Path, out: Path, first: int | None) -> None:
    """Write the model of a VERDICT (what --json wrote), with all its places or the first ones."""
    import msgspec

    from smad.diagnosis.errors import GapError
    from smad.diagnosis.model_file import apply as write
    from smad.diagnosis.verdict import Verdict

    try:
        told = Verdict.from_json(verdict.read_bytes())
    except msgspec.DecodeError as error:
        raise GapError(
            f"{verdict} is no verdict",
            value=str(error),
            action="give a file that smad gap diagnose --json wrote",
        ) from error
    write(told, out, first)
    kept = told.places if first is None else told.places[:first]
    click.echo(f"{out}: parameters" + "".join(f", {p.words}" for p in kept))


@gap.command()
@_variant
@click.option("--json", "as_json", is_flag=True, help="Print JSON instead of a table.")
def effects(*, variant: str, as_json: bool) -> None:
    """List the candidate effects, from the registry."""
    import msgspec

    from smad.diagnosis.spring_pair import SmaPlant

    library = SmaPlant(variant=variant).effects
    if as_json:
        click.echo(msgspec.json.format(msgspec.json.encode(list(library)), indent=1).decode())
        return
    for e in library:
        click.echo(f"{e.name}  ({e.sub_model}: {', '.join(e.signals)})")
        click.echo(f"    {e.title}: {e.equation}")
        click.echo(f"    places: {', '.join(e.places)}")
        for q in e.parameters:
            kind = "" if q.strength else ", shape"
            high = f"{q.high:g}" + (f" {q.unit}" if q.unit != "1" else "")
            click.echo(f"    {q.name}: {q.low:g} to {high}, typically {q.typical:g}{kind}")
        click.echo(f"    confused with: {', '.join(e.confused_with) or 'nothing known'}")
        click.echo(f"    told apart by: {e.separates}")
        click.echo(f"    source: {e.reference}")


@gap.command()
@runs_argument
@click.option("--model", "model_path", required=True, type=_RUN, help="Model file of --apply.")
@_params
@_variant
@click.option("--json", "as_json", is_flag=True, help="Print JSON instead of a table.")
def verify(
    *, runs: tuple[Path, ...], model_path: Path, params: str, variant: str, as_json: bool
) -> None:
    """Show the gap of RUNs, which the model has not seen, before and after it."""
    import msgspec

    plant = _plant(params, variant)
    with _clean_errors():
        from smad.diagnosis.verify import verified

        rows = verified(plant, _read(runs, runs), plant.load_model(model_path))
    if as_json:
        click.echo(msgspec.json.format(msgspec.json.encode(rows), indent=1).decode())
        return
    click.echo(f"{'RMS of measured − predicted':<29} {'before':>9} {'after':>9} {'floor':>9}")
    for r in rows:
        click.echo(f"{r.signal:<21} {r.unit:<7} {r.raw:>9.3g} {r.final:>9.3g} {r.floor:>9.3g}")


@gap.command(name="next", cls=ManyRuns)
@some_runs_argument
@hold_out_option
@good_option
@click.option("--run", "chosen", metavar="NAME",
              help="Carry out this experiment now: arms the bench and heats it.")  # fmt: skip
@click.option("--baseline", type=click.Path(file_okay=False, path_type=Path),
              help="What to play again after a check-up against it, in place of RUNs.")  # fmt: skip
@click.option("--sim", is_flag=True, help="With --run: in virtual time instead of on the bench.")
@click.option("--model", "model_path", type=_RUN, help="With --sim: model of the simulated bench.")
@click.option("--effect", "bench_effects", multiple=True, metavar="NAME[:P=V,…]",
              shell_complete=complete.effects,
              help="With --sim: an effect that the simulated bench has.")  # fmt: skip
@click.option("--folder", type=click.Path(path_type=Path), default=Path("runs"), show_default=True,
              help="With --sim: where the run log goes.")  # fmt: skip
@bench_option
@_params
@_variant
@_seed
def next_experiment(
    *,
    runs: tuple[Path, ...],
    hold_out: tuple[Path, ...],
    good: tuple[Path, ...],
    chosen: str | None,
    baseline: Path | None,
    sim: bool,
    model_path: Path | None,
    bench_effects: tuple[str, ...],
    folder: Path,
    bench: str,
    params: str,
    variant: str,
    seed: int,
) -> None:
    """Recommend the experiment that would best separate what RUNs leave confused; or run one.

    Without RUNs the catalogue is listed. --run takes a name from it, and writes a run log.
    """
    if chosen is not None and runs:
        raise click.UsageError("--run carries an experiment out; give RUNs without it")
    if (bench_effects or model_path) and not sim:
        raise click.UsageError("--model and --effect are of a simulated bench; add --sim")
    if sim and chosen is None:
        raise click.UsageError("--sim says where --run runs; give --run NAME too")
    if baseline is not None:
        if runs or chosen is not None:
            raise click.UsageError("--baseline has its own runs; give neither RUNs nor --run")
        _propose(baseline)
        return
    plant = _plant(params, variant)
    with _clean_errors():
        if chosen is not None:
            if sim:
                point = _simulated_point(plant, model_path, bench_effects)
                _simulate(plant, chosen, seed, folder, point)
            else:
                _perform(chosen, seed, bench)
            return
        if not runs:
            _list_catalogue()
            return
        from smad.diagnosis.next_run import offers

        good = uncut(good)
        answer = _diagnosed(plant, runs, good, hold_out)
        _print_verdict(answer.verdict, "")
        with progress() as line:
            confused, found = offers(answer, line.say)
    if not confused:
        click.echo("Nothing is confused that a run of the catalogue could tell apart.")
        return
    click.echo(f"Not told apart: {' or '.join(confused)}. Least d² between two of them:")
    for x in found[:_OFFERS]:
        click.echo(f"  d² {x.separation:>7.1f}  {x.duration_s:>4.0f} s  {x.title}:  {x.command}")


def _propose(baseline: Path) -> None:
    from smad.cli.gap_investigate import proposal

    found = proposal(baseline, None)
    click.echo(f"{found.run} {found.why}" if found.run else found.why)
    for offer in found.offers:
        click.echo(f"  {offer.run:<10} d² = {offer.separation:.1f}")
    if found.run is not None:
        click.echo("smad gap investigate plays it, and goes on until it is settled")


def _plant(params: str, variant: str) -> SmaPlant:
    from sim_device.plant import load_parameters
    from smad.diagnosis.spring_pair import SmaPlant

    with _clean_errors():
        return SmaPlant(load_parameters(params), variant)


@contextlib.contextmanager
def _clean_errors() -> Iterator[None]:
    """Errors of the plant become one line, as all others."""
    from sim_device.plant.errors import PlantError
    from smad.diagnosis.errors import GapError

    try:
        yield
    except PlantError as error:
        raise GapError(str(error)) from error


def _read(paths: Sequence[Path], among: Sequence[Path]) -> list[GapRun]:
    from smad.diagnosis.spring_pair.signals import read_gap_run
    from smad.runlog.bounds import Together

    together = Together()
    runs = [read_gap_run(path, together) for path in paths]
    names = [_unlike(path, among) for path in paths]
    return [
        dataclasses.replace(run, name=name) if name else run
        for run, name in zip(runs, names, strict=True)
    ]


def _unlike(path: Path, paths: Sequence[Path]) -> str:
    """A name with as much of the folder as tells two files of one name apart; empty: no need."""
    alike = [p for p in paths if p != path and p.name == path.name]
    parts = path.absolute().parts
    for k in range(2, len(parts) + 1):
        if not any(p.absolute().parts[-k:] == parts[-k:] for p in alike):
            return "/".join((*parts[-k:-1], path.stem)) if alike else ""
    return ""


def _diagnosed(
    plant: SmaPlant, runs: Sequence[Path], good: Sequence[Path], hold_out: Sequence[Path]
) -> Answer:
    import msgspec

    from smad.checkup.everyday import repeated
    from smad.checkup.files import Found
    from smad.diagnosis import diagnose

    with progress() as line:
        say: Callable[[str], None] = line.say
        say("reading")
        everything = (*runs, *good, *hold_out)
        asked, known, held = (_read(some, everything) for some in (runs, good, hold_out))
        found = diagnose(asked, plant=plant, good=known, hold_out=held, progress=say)
        now = [Found.of(*x) for x in zip((*runs, *hold_out), (*asked, *held), strict=True)]
        then = [Found.of(*x) for x in zip(good, known, strict=True)]
        verdict = msgspec.structs.replace(found.verdict, repeated=repeated(plant, then, now, say))
        return dataclasses.replace(found, verdict=verdict)


def _asked(runs: Sequence[Path], hold_out: Sequence[Path], good: Sequence[Path]) -> str:
    """The arguments as a shell takes them, to ask once more."""
    words = [str(path) for path in runs]
    for option, paths in (("--hold-out", hold_out), ("--good", good)):
        words += [option, *map(str, paths)] if paths else []
    return shlex.join(words)


def _print_verdict(verdict: Verdict, asked: str) -> None:
    from smad.diagnosis.report.words import advice

    print_verdict(verdict)
    for command, why in advice(verdict, asked) if asked else ():
        click.echo(f"{why}: {command}" if command else why)


def _list_catalogue() -> None:
    from smad.diagnosis.spring_pair.catalogue import CATALOGUE, ROUTINE

    for heading, timelines in (
        ("everyday runs, to fit on and to judge on", ROUTINE),
        ("to tell causes apart", CATALOGUE),
    ):
        click.echo(f"{heading}:")
        for t in timelines:
            click.echo(f"  {t.name:<16} {t.duration_s:>4.0f} s  {t.title}")


def _perform(name: str, seed: int, bench: str) -> None:
    """Carries an experiment out on the bench."""
    from smad.cli.benches import LEASE_S
    from smad.cli.leased import LeasedDriver
    from smad.cli.output import client, shown
    from smad.client.signals import ended_by_signals
    from smad.diagnosis.spring_pair.catalogue import plan_named
    from smad.experiments.live import LiveDriver
    from smad.experiments.ready import require_ready

    plan = plan_named(name, seed)
    with ended_by_signals(), client(bench) as connected, progress() as line:
        connected.as_of(connected.motion().generation)
        require_ready(connected, extra="gap")
        driver = LiveDriver(connected, progress=line.say)
        LeasedDriver(
            connected, driver, lease_s=LEASE_S, progress=line.say, who="smad gap next"
        ).run(plan)
    click.echo(f"done: {name}, recorded to {shown(driver.log or plan.name)}")


def _simulated_point(
    plant: SmaPlant, model_path: Path | None, effects: Sequence[str]
) -> ModelPoint:
    """The simulated bench: the model, or the nominal one, with effects in place of its own."""
    from sim_device.plant.effects.registry import from_text, resolve
    from smad.diagnosis.plant import ModelPoint

    point = ModelPoint({}) if model_path is None else plant.load_model(model_path)
    more = resolve(dict(from_text(text) for text in effects))
    return ModelPoint(point.theta, {**point.effects, **more})


def _simulate(plant: SmaPlant, name: str, seed: int, folder: Path, point: ModelPoint) -> None:
    """Carries an experiment out on a simulated bench in virtual time; says where its run log is."""
    from smad.diagnosis.errors import GapError
    from smad.diagnosis.spring_pair.catalogue import plan_named
    from smad.experiments.driver import log_path
    from smad.experiments.virtual import VirtualDriver

    plan = plan_named(name, seed)
    if seed:
        plan = dataclasses.replace(plan, name=f"{plan.name} {seed}")
    path = log_path(folder, plan)
    if path.exists():
        raise GapError(
            "a run log of that name is there already",
            value=str(path),
            action="give another --folder or --seed, or move it away",
        )
    with progress() as line:
        VirtualDriver(
            plant.set_of(point.theta),
            variant=plant.variant,
            effects=point.effects,
            seed=seed,
            folder=folder,
            progress=line.say,
        ).run(plan)
    click.echo(f"done: {path}")
