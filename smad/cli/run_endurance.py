"""`smad run endurance`: one cycle many times, with statistics, check-ups and limits that end it."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from smad.cli.output import (
    FOLDER,
    Checked,
    axis_option,
    lease_option,
    leased_driver,
    progress,
    ready_client,
)
from smad.cli.quantity import Quantity, Whole
from smad.cli.simulated import effect_option, require_sim, seed_option, sim_option, simulated_model
from smad.counted import counted
from smad.errors import SmadError
from smad.progress import Say

if TYPE_CHECKING:
    from smad.config import Config
    from smad.experiments.endurance.profile import Profile
    from smad.experiments.endurance.run import BlockDriver, Endurance, Judgement

_percent = Quantity("pct", 0.0, 100.0, above=True)


def _require_pairs(given: Mapping[str, Any]) -> None:
    if given["displacement"] and given["temperature"]:
        raise click.UsageError("give --displacement or --temperature")
    if given["every"] and given["baseline"] is None:
        raise click.UsageError("--every N checkup needs --baseline FOLDER (of smad gap commission)")
    if given["end_place"] is not None and not given["every"]:
        raise click.UsageError("--end-place needs --every N checkup")
    require_sim(given["effects"], sim=given["sim"])


@click.command(cls=Checked, require=_require_pairs)
@click.option("--cycles", type=Whole(1, 10_000_000), required=True, help="How many.")
@click.option(
    "--displacement",
    nargs=2,
    type=Quantity("mm", -20.0, 20.0),
    metavar="LOW HIGH",
    help="Cycle between these, mm  [default: -5 5]",
)
@click.option(
    "--temperature",
    nargs=2,
    type=Quantity("degC", 0.0, 95.0),
    metavar="LOW HIGH",
    help="Cycle one spring between these instead, °C.",
)
@click.option(
    "--spring", type=click.Choice(["x", "y"]), default="x", help="With --temperature: the spring."
)
@click.option(
    "--rate",
    type=Quantity(low=0.01, high=50.0),
    default=2.0,
    metavar="MM/S",
    help="Rate of the ramps; K/s with --temperature.",
)
@click.option(
    "--dwell", type=Quantity("s", 0.0, 600.0), default=1.0, metavar="S", help="Pause at each end."
)
@click.option(
    "--every",
    nargs=2,
    type=(Whole(1), click.Choice(["checkup"])),
    metavar="N checkup",
    help="Play the quick check-up every N cycles.",
)
@click.option("--baseline", type=FOLDER, help="Baseline of the check-ups.")
@click.option(
    "--end-stroke-lost", type=_percent, metavar="%", help="End when this much stroke is lost."
)
@click.option(
    "--end-resistance-up",
    type=_percent,
    metavar="%",
    help="End when resistance has risen by this much.",
)
@click.option(
    "--end-shift",
    type=Quantity("K", 0.0, 100.0, above=True),
    metavar="K",
    help="End when the transformation shifted.",
)
@click.option(
    "--end-place",
    type=Quantity("1", 0.0, 1.0, above=True),
    metavar="P",
    help="End when a place has changed with this probability.",
)
@click.option(
    "--full-every",
    type=Whole(1, 1_000_000),
    default=1,
    help="Keep all samples of every n-th cycle, only statistics of the others.",
)
@click.option("--folder", type=FOLDER, default=Path("endurance"), help="Where cycles.csv goes.")
@click.option("--go-on", is_flag=True, help="Go on after the cycles that the folder has.")
@sim_option
@effect_option
@seed_option
@lease_option
@axis_option
def endurance(**options: Any) -> None:
    """Cycle between two displacements or temperatures until a limit ends it.

    Each block, at most three quarters of the longest time armed or of one file, begins from rest
    and has a run log of its own. FOLDER/cycles.csv has the statistics of every cycle. The disk
    space is printed and reserved first. A stop, a fault, or a check-up that fails ends the run.
    Look at the bench before you give --go-on, which also counts what a killed run recorded.
    """
    from smad.experiments.endurance.run import earlier_cycles, endure, on_bench, take_over_killed
    from smad.experiments.ready import require_packages
    from smad.runlog.paths import make_folder

    require_packages("gap" if options["every"] else "sim")
    folder: Path = options["folder"]
    earlier = earlier_cycles(folder)
    if earlier and not options["go_on"]:
        raise SmadError(
            f"{folder} has {counted(earlier, 'cycle')} already",
            action="name another folder, or give --go-on to go on after them",
        )
    plan = _plan_of(options, earlier + 1)
    make_folder(folder)
    with contextlib.ExitStack() as stack:
        line = stack.enter_context(progress())
        driver, config, logs = stack.enter_context(_bench(options, folder, line.say))
        if options["go_on"]:
            late = take_over_killed(logs, plan.profile, folder, plan.first)
            if late:
                click.echo(
                    f"{counted(late, 'cycle')} of a killed block taken over from its run log"
                )
            plan = replace(plan, first=plan.first + late)
        plan, room = on_bench(plan, config)
        hours = plan.cycles * plan.profile.period_s / 3600.0
        click.echo(
            f"{counted(plan.cycles, 'cycle')}, about {hours:.1f} h of board time; {room.in_words()}"
        )
        ended = endure(
            plan,
            driver,
            folder,
            room,
            logs=logs,
            check=_checker(options, folder, driver),
            say=line.say,
        )
    for number, judgement in ended.judgements:
        click.echo(f"check-up after {counted(number, 'cycle')}: {judgement.headline}")
    click.echo(
        f"ended after {counted(ended.cycles, 'cycle')}: {ended.reason}; {folder / 'cycles.csv'}"
    )


def _plan_of(options: dict[str, Any], first: int) -> Endurance:
    from smad.experiments.endurance.limits import EndLimits
    from smad.experiments.endurance.run import Endurance

    baseline: Path | None = options["baseline"]
    if baseline is not None and not (baseline / "baseline.json").exists():
        raise SmadError(
            f"there is no baseline in {baseline}",
            action="commission the bench (smad gap commission), or name another; nothing was moved",
        )
    return Endurance(
        profile=profile_of(options),
        cycles=options["cycles"],
        limits=EndLimits(
            stroke_lost_percent=options["end_stroke_lost"],
            resistance_up_percent=options["end_resistance_up"],
            shift_K=options["end_shift"],
            place_probability=options["end_place"],
        ),
        check_every=options["every"][0] if options["every"] else 0,
        full_every=options["full_every"],
        first=first,
    )


def profile_of(options: dict[str, Any]) -> Profile:
    """Return the cycle that is asked for. Raises ExperimentError."""
    from smad.experiments.endurance.profile import Profile

    low, high = options["temperature"] or options["displacement"] or (-5.0, 5.0)
    return Profile(
        quantity="temperature" if options["temperature"] else "displacement",
        low=low,
        high=high,
        rate=options["rate"],
        dwell_s=options["dwell"],
        spring=options["spring"],
    )


@contextlib.contextmanager
def _bench(
    options: dict[str, Any], folder: Path, say: Say
) -> Iterator[tuple[BlockDriver, Config, Path]]:
    """The driver, the configuration of its bench, and where its run logs go."""
    from smad.config import Config, parse_config
    from smad.experiments.virtual import VirtualDriver

    if options["sim"]:
        model = simulated_model(options["effects"])
        yield VirtualDriver(model, seed=options["seed"], folder=folder), Config(), folder
        return
    with ready_client(options["bench"]) as connected:
        driver = leased_driver(connected, "smad run endurance", options["lease"], say)
        logs = Path(connected.status().recorder.folder)
        yield driver, parse_config(connected.config()), logs


def _checker(
    options: dict[str, Any], folder: Path, driver: BlockDriver
) -> Callable[[int], Judgement] | None:
    from smad.experiments.endurance.judgement import checker

    if not options["every"]:
        return None

    def words(number: int) -> list[str]:
        out = [f"--baseline={options['baseline']}", f"--out={folder / f'checkup-{number:07d}'}"]
        if options["sim"]:
            out += ["--sim", f"--seed={options['seed'] + number}"]
            out += [f"--effect={text}" for text in options["effects"]]
        return out

    return checker(words, options["bench"], driver)
