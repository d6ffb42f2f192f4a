"""`smad gap`: where simulator and bench disagree, because of what, and how much of it goes."""

from __future__ import annotations

import contextlib
import dataclasses
import shlex
import shutil
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import click

from smad.cli import complete
from smad.cli.gap_check import check, score
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
    from smad.diagnosis.plant import ModelPoint
    from smad.diagnosis.runs import GapRun
    from smad.diagnosis.spring_pair import SmaPlant
    from smad.gap.records import Diagnosis, ExperimentRecord
    from smad.gap.report import Asked

_RUN = click.Path(exists=True, dir_okay=False, path_type=Path)
_OUT = click.Path(dir_okay=False, path_type=Path)

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
gap.add_command(score)
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
@_seed
@click.option("--json", "json_path", type=_OUT, help="Write the whole diagnosis here.")
@click.option("--html", "html_path", type=_OUT, help="Write the report page here.")
@click.option("--apply", "model_path", type=_OUT, help="Write the improved model here.")
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
    seed: int,
    json_path: Path | None,
    html_path: Path | None,
    model_path: Path | None,
    fmu: Path | None,
    map_path: Path | None,
) -> None:
    """Say where model and RUNs disagree, because of what, and how much of the gap goes.

    With --good the question is what has changed since those runs; without, every difference between
    model and bench counts. Without --hold-out each run is left out in turn.

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
    plant = None if fmu is not None else _plant(params, variant)
    with _clean_errors():
        if plant is None:
            assert fmu is not None
            assert map_path is not None
            result = _of_unit((fmu, map_path), runs, good, hold_out, seed)
        else:
            result = _diagnosed(plant, runs, good, hold_out, seed)
        # Of a plant that is not ours, no command but this one is known.
        asked = None if plant is None else _asked(runs, hold_out, good, model_path)
        _print_verdict(result, asked)
        if json_path is not None:
            json_path.write_bytes(result.to_json())
        if html_path is not None:
            from smad.gap.report import page_of
            from smad.report.page import write_page

            write_page(page_of(result, asked), html_path)
        if model_path is not None and plant is not None:
            from smad.diagnosis.model_file import apply

            apply(result, plant, model_path)
    for path in (json_path, html_path, model_path):
        if path is not None:
            click.echo(f"written: {path}", err=True)


@gap.command()
@_variant
@click.option("--json", "as_json", is_flag=True, help="Print JSON instead of a table.")
def effects(*, variant: str, as_json: bool) -> None:
    """List the candidate effects, from the registry."""
    import msgspec

    from smad.diagnosis.spring_pair import SmaPlant
    from smad.gap.report.terms import with_unit

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
            high = with_unit(f"{q.high:g}", q.unit)
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
    width = max(len(r.channel) for r in rows)
    click.echo(f"{'channel':<{width}}  {'floor':>14}  {'before':>9}  {'after':>9}  {'shrink':>6}")
    for r in rows:
        floor = f"{r.floor:.3g} {r.unit}" if r.unit else ""
        click.echo(
            f"{r.channel:<{width}}  {floor:>14}  {r.before:>8.2f}×  {r.after:>8.2f}×  "
            f"{r.shrink:>6.2f}"
        )


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
        good = uncut(good)
        result = _diagnosed(plant, runs, good, hold_out, seed)
    _print_verdict(result, _asked(runs, hold_out, good, None))
    from smad.gap.settings import enough_d2

    _print_experiments(result.experiments, enough_d2(result.settings["odds"]))


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
    plant: SmaPlant,
    runs: Sequence[Path],
    good: Sequence[Path],
    hold_out: Sequence[Path],
    seed: int,
) -> Diagnosis:
    import msgspec

    from smad.checkup.everyday import repeated
    from smad.checkup.files import Found
    from smad.gap import Settings, diagnose

    with progress() as line:
        say: Callable[[str], None] = line.say
        say("reading")
        everything = (*runs, *good, *hold_out)
        asked, known, held = (_read(some, everything) for some in (runs, good, hold_out))
        found = diagnose(
            asked,
            plant=plant,
            good=known,
            hold_out=held,
            settings=Settings(seed=seed),
            progress=say,
        )
        now = [Found.of(*x) for x in zip((*runs, *hold_out), (*asked, *held), strict=True)]
        then = [Found.of(*x) for x in zip(good, known, strict=True)]
        return msgspec.structs.replace(found, repeated=repeated(plant, then, now, say))


def _of_unit(
    unit: tuple[Path, Path],
    runs: Sequence[Path],
    good: Sequence[Path],
    hold_out: Sequence[Path],
    seed: int,
) -> Diagnosis:
    from smad.fmi.asked import diagnose_unit

    with progress() as line:
        return diagnose_unit(
            *unit, runs, good=good, hold_out=hold_out, seed=seed, progress=line.say
        )


def _asked(
    runs: Sequence[Path], hold_out: Sequence[Path], good: Sequence[Path], model: Path | None
) -> Asked:
    """The arguments as a shell takes them, to ask once more."""
    from smad.gap.report import Asked

    words = [str(path) for path in runs]
    for option, paths in (("--hold-out", hold_out), ("--good", good)):
        words += [option, *map(str, paths)] if paths else []
    return Asked(shlex.join(words), "" if model is None else str(model))


def _print_verdict(result: Diagnosis, asked: Asked | None) -> None:
    from smad.gap.report import summary_lines

    headline, *rest = summary_lines(result, asked)
    width = min(100, shutil.get_terminal_size((100, 24)).columns)
    click.secho(headline, bold=True)
    for text in rest:
        click.echo(text if text.startswith("  ") else click.wrap_text(text, width=width))


def _print_experiments(found: Sequence[ExperimentRecord], wanted: float) -> None:
    """Proposals with their commands; without any, the verdict has said why."""
    if not found:
        return
    for x in found:
        counted = x.counted or 0.0
        click.echo(f"d² {counted:>7.1f}  {x.duration_s:>4.0f} s  {x.title}:  {x.command}")
    together = found[-1].together or 0.0
    click.echo(f"Together d² {together:.1f}, one run of each; {wanted:.0f} tell two causes apart.")


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
