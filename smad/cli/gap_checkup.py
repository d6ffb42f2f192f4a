"""`smad gap commission` and `smad gap checkup`: the bench as its own control."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import click

from smad.cli.baselines import (
    chosen_programme,
    new_plant,
    other_part,
    player,
    print_verdict,
    require_same,
    say,
)
from smad.cli.gap_runs import tell_passed_over
from smad.cli.output import axis_option, progress
from smad.files import named_output, require_writable

if TYPE_CHECKING:
    from smad.checkup.files import Found
    from smad.checkup.judge import Judged
    from smad.checkup.programme import Programme
    from smad.checkup.series import Play
    from smad.checkup.store import Baseline
    from smad.diagnosis.runs import GapRun
    from smad.diagnosis.spring_pair import SmaPlant

_FOLDER = click.Path(file_okay=False, path_type=Path)
_OUT = click.Path(dir_okay=False, path_type=Path)

_sim = click.option("--sim", is_flag=True, help="On a simulated bench in virtual time.")
_effect = click.option("--effect", "effects", multiple=True, metavar="NAME[:P=V,…]",
                       help="With --sim: an effect that the simulated bench has.")  # fmt: skip
_seed = click.option("--seed", type=click.IntRange(0, 2**32 - 1), default=0, show_default=True,
                     help="With --sim: of its noise.")  # fmt: skip
_programme = click.option("--programme", "programme_folder", type=_FOLDER,
                          help="Another programme than the one in the package.")  # fmt: skip


@click.command()
@click.option("--baseline", "folder", type=_FOLDER, required=True, help="Where the baseline goes.")
@click.option("--repeats", type=click.IntRange(1, 8), default=2, show_default=True,
              help="How often the whole programme is played.")  # fmt: skip
@click.option("--again", is_flag=True, help="Add repeats to a baseline: the floor gets better.")
@click.option("--quick", is_flag=True, help="Only the part that separates most.")
@_sim
@_seed
@_programme
@axis_option
def commission(
    *,
    folder: Path,
    repeats: int,
    again: bool,
    quick: bool,
    sim: bool,
    seed: int,
    programme_folder: Path | None,
    bench: str,
) -> None:
    """Record what a good bench makes of the programme, and compute a baseline from it.

    Runs are kept in FOLDER/good-1, good-2 …; interrupted, the same command goes on after the last
    run that was finished. A baseline that cannot be read, or is of another version of smad, is
    computed anew from its runs. Arms the bench and heats it.
    """
    from smad.checkup.commission import commissioned
    from smad.checkup.errors import BaselineError
    from smad.checkup.series import finished, folder_for, play_series
    from smad.checkup.store import Baseline, save

    plant = new_plant()
    programme = chosen_programme(programme_folder, quick)
    whose = "simulated" if sim else bench
    known = _known(folder, plant)
    if known is not None and not again:
        raise BaselineError(
            f"{folder} is a baseline already",
            action="add repeats to it with --again, or give another folder",
        )
    if known is not None:
        require_same(folder, known.bench, whose, known.programme, programme)
    _require_its_runs(folder, programme)
    before = 0 if known is None else known.reference.repeats
    with contextlib.ExitStack() as stack:
        # On a bench one client plays all repeats: a new one would not know of a stop before it.
        play: Play | None = None
        while (have := len(finished(_good(folder), programme))) < before + repeats:
            place = folder_for(folder, "good", programme, time.time)
            originals = None if place.name == "good-1" else folder / "good-1"
            number = int(place.name.removeprefix("good-"))
            if sim or play is None:
                stack.close()
                own = player(sim=sim, seed=seed + number, effects=(), bench=bench)
                play = stack.enter_context(own)
            ended = play_series(place, programme, play, originals, say)
            if ended:
                raise BaselineError(
                    f"{place.name} is no repeat of good-1, and is left out: {ended}",
                    value=f"{have} repeats so far",
                    action="see what changed on the bench, then give the same command again",
                )
    repeated = _read_repeats(finished(_good(folder), programme), programme)
    with progress() as line:
        reference = commissioned(plant, repeated, progress=line.say)
    save(Baseline(whose, programme.digest, reference), plant, folder)
    minutes = programme.duration_s / 60.0
    click.echo(
        f"baseline {folder}: {len(programme.runs)} runs of {minutes:.1f} min in all, "
        f"{reference.repeats} repeats of each"
    )
    if reference.repeats < 2:
        click.echo("one repeat leaves the floor a guess; add another with --again", err=True)


@click.command()
@click.option("--baseline", "folder", type=_FOLDER, help="Play its programme again, and judge.")
@click.option("--good", type=_FOLDER, help="Run files of a good day, several repeats at best.")
@click.option("--now", type=_FOLDER, help="Run files of now: the same inputs as the good ones.")
@click.option("--quick", is_flag=True, help="With --baseline: the part that separates most.")
@click.option("--out", type=_FOLDER, help="With --baseline: where the runs of now go  [default: "
              "BASELINE/now-1, now-2 …]")  # fmt: skip
@_sim
@_effect
@_seed
@_programme
@axis_option
@click.option("--json", "json_path", type=_OUT, help="Write the verdict here.")
@click.option("--report", "page_path", type=_OUT, help="Write a page with figures here.")
@click.option("--model", "model_path", type=_OUT,
              help="Write the model with what was found here: effects and laws.")  # fmt: skip
def checkup(
    *,
    folder: Path | None,
    good: Path | None,
    now: Path | None,
    quick: bool,
    out: Path | None,
    sim: bool,
    effects: tuple[str, ...],
    seed: int,
    programme_folder: Path | None,
    bench: str,
    json_path: Path | None,
    page_path: Path | None,
    model_path: Path | None,
) -> None:
    """Say what has changed since the bench was good, from equal inputs then and now.

    With --baseline the programme is played (or read, with --now) and compared with the baseline.
    With --good and --now run files are compared: run logs, CSV or Parquet with units in their
    columns' names. Runs are paired by their inputs, and by name where several fit. A good run that
    a stop cut is told of and left out.
    """
    if (folder is None) == (good is None):
        raise click.UsageError("give --baseline, or --good and --now")
    if good is not None and now is None:
        raise click.UsageError("--good needs --now: the runs to judge")
    if effects and not sim:
        raise click.UsageError("--effect is of a simulated bench; add --sim")
    for path in (json_path, page_path, model_path):
        if path is not None:
            require_writable(path)
    if good is not None:
        found = _of_files(good, now)
    else:
        assert folder is not None
        programme = chosen_programme(programme_folder, quick)
        found = _of_baseline(
            folder, programme, now, out, sim=sim, effects=effects, seed=seed, bench=bench
        )
    verdict, written = found.verdict, []
    if json_path is not None:
        with named_output(json_path) as path:
            path.write_bytes(verdict.to_json())
        written.append(json_path)
    if page_path is not None:
        from smad.diagnosis.report.page import page_of
        from smad.report.page import write_page

        facts = [("baseline", str(folder or good)), ("repeats", str(found.pairs.reference.repeats))]
        written.append(write_page(page_of(found.answer, facts=facts), page_path))
    if model_path is not None:
        from smad.checkup.judge import save_found

        with named_output(model_path) as path:
            save_found(new_plant(), found, path)
        written.append(model_path)
    print_verdict(verdict)
    for path in written:
        click.echo(f"written: {path}", err=True)


def _of_files(good: Path, now: Path | None) -> Judged:
    from smad.checkup.commission import checked_files
    from smad.checkup.files import read_folder, read_good

    assert now is not None
    with progress() as line:
        line.say("reading")
        then, asked = read_good(good, say), read_folder(now)
        for folder, runs in ((good, then), (now, asked)):
            there = sorted(p for p in folder.rglob("*") if p.is_file())
            tell_passed_over(folder, there, [run.path for run in runs])
        for run in (*then, *asked):
            for note in run.run.notes:
                say(f"{run.path}: {note}")
        found, matched = checked_files(new_plant(), then, asked, progress=line.say)
    for text in matched.lines:
        click.echo(text, err=True)
    for name in matched.alone:
        click.echo(f"{name} has the inputs of no good run, and is left out", err=True)
    return found


def _of_baseline(
    folder: Path,
    programme: Programme,
    now: Path | None,
    out: Path | None,
    *,
    sim: bool,
    effects: Sequence[str],
    seed: int,
    bench: str,
) -> Judged:
    from smad.checkup.errors import BaselineError
    from smad.checkup.files import read_folder
    from smad.checkup.judge import judged
    from smad.checkup.series import folder_for, play_series, read_state
    from smad.checkup.store import load

    plant = new_plant()
    baseline = load(folder, plant)
    known = {r.name for r in baseline.reference.runs}
    played = now is None
    if now is None:
        require_same(folder, baseline.bench, "simulated" if sim else bench, baseline.programme,
                      programme, part=True)  # fmt: skip
        # A baseline of the quick part has nothing to compare the other runs with.
        own = tuple(run for run in programme.runs if run.name in known)
        programme = replace(programme, runs=own)
        now = out or folder_for(folder, "now", programme, time.time)
        with player(sim=sim, seed=seed + 1000, effects=effects, bench=bench) as play:
            play_series(now, programme, play, folder / "good-1", say)
    state = read_state(now)
    if state is not None and state.ended:
        click.echo(f"not all of it was played: {state.ended}", err=True)
    found = [f for f in read_folder(now) if f.name in known]
    for run in found:
        for note in run.run.notes:
            say(f"{run.path}: {note}")
    if not played:
        _require_other_runs(folder, found)
    runs = [(f.run, f.name) for f in found]
    if not runs:
        raise BaselineError(
            f"{now} holds no run of the baseline {folder}",
            limit=", ".join(sorted(known)),
            action="name the files after the runs of the programme, or use --good",
        )
    with progress() as line:
        return judged(plant, baseline.reference, runs, progress=line.say)


def _require_other_runs(folder: Path, now: Sequence[Found]) -> None:
    """Raises PairingError when runs of now are good ones of the baseline, or of another bench."""
    from smad.checkup.files import (
        read_folder,
        require_one_bench,
        require_other_recordings,
    )

    for place in _good(folder):
        good = [f for f in read_folder(place) if f.name in {n.name for n in now}]
        require_one_bench([*good, *now])
        require_other_recordings(good, now)


def _known(folder: Path, plant: SmaPlant) -> Baseline | None:
    """The baseline of a folder; None where there is none, or none that this version can read."""
    from smad.checkup.errors import BaselineError
    from smad.checkup.store import load

    if not (folder / "baseline.json").exists():
        return None
    try:
        return load(folder, plant)
    except BaselineError as error:
        say(f"{error.cause}; computed anew from the runs in {folder}")
        return None


def _require_its_runs(folder: Path, programme: Programme) -> None:
    """Raises BaselineError when the good runs that are there are of another programme."""
    from smad.checkup.errors import BaselineError
    from smad.checkup.series import read_state

    for place in _good(folder):
        state = read_state(place)
        if state is not None and state.programme != programme.digest:
            raise BaselineError(
                f"{place} holds runs of another programme",
                value=state.programme[:12],
                limit=programme.digest[:12],
                action=other_part(state.programme) or "give another folder",
            )


def _good(folder: Path) -> list[Path]:
    found = (p for p in folder.glob("good-*") if p.name.removeprefix("good-").isdecimal())
    return sorted(found, key=lambda p: int(p.name.removeprefix("good-")))


def _read_repeats(places: Sequence[Path], programme: Programme) -> list[list[GapRun]]:
    from smad.checkup.files import read_folder, require_one_bench

    found = [{f.name: f for f in read_folder(p)} for p in places]
    require_one_bench([f for own in found for f in own.values()])
    return [[replace(own[run.name].run, name=run.name) for own in found] for run in programme.runs]
