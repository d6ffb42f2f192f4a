"""The command line of the campaigns; every error ends in one sentence, not a traceback."""

from __future__ import annotations

import sys
import time
from collections.abc import Sequence
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path

import click

from campaign.faults import report
from campaign.faults.cases import chosen_rows, outcomes, pair_cases, single_cases
from campaign.faults.catalogue import ROWS
from campaign.faults.process import HOST_FAULTS, run_host_fault
from campaign.faults.report import Judged, judged
from campaign.fuzz.command import fuzz
from campaign.hostile import attacks
from campaign.hostile.rig import Scale
from campaign.soak import report as soak_report
from campaign.soak.found import FULL
from campaign.soak.run import run_stage
from firmware_protocol.nearest import instead
from smad.cli import root as smad_root
from smad.cli import run_group
from smad.cli.quantity import Quantity, Whole
from smad.client.signals import ended_by_signals
from smad.errors import CommandError
from smad.report.page import write_page
from smad.view.terminal.progress import progress
from smad.view.terminal.tables import print_table

_PAIRS_A_COUNT = 5
_SHOWN = 5


@click.group(context_settings={"help_option_names": ["-h", "--help"]})
def root() -> None:
    """Try whether a daemon keeps a bench safe and its record whole."""


def main(arguments: Sequence[str] | None = None) -> None:
    """Run a campaign and exit with its status."""
    sys.exit(execute(sys.argv[1:] if arguments is None else arguments))


def execute(arguments: Sequence[str]) -> int:
    """Run one campaign; return its exit status. Errors become one line on standard error."""
    return run_group(root, arguments, "python -m campaign")


@root.command("faults")
@click.option("--only", multiple=True, metavar="NAME", help="Only this fault; repeat for more.")
@click.option("--seed", type=Whole(0, 2**32 - 1), default=1, show_default=True)
@click.option(
    "--count",
    type=Whole(1),
    default=1000,
    show_default=True,
    help="Injections in lockstep; the faults take turns.",
)
@click.option(
    "--pairs",
    type=Whole(0),
    help="Pairs of faults besides; a fifth of the count unless --only is given.",
)
@click.option("--lockstep", is_flag=True, help="Only on virtual time, without processes.")
@click.option("--process", is_flag=True, help="Only with a real daemon process.")
@click.option("--jobs", type=Whole(1), help="Processes to run on; one a core.")
@click.option("--json", "json_path", type=click.Path(path_type=Path), metavar="FILE")
@click.option("--report", "page_path", type=click.Path(path_type=Path), metavar="FILE")
def faults_command(
    *,
    only: tuple[str, ...],
    seed: int,
    count: int,
    pairs: int | None,
    lockstep: bool,
    process: bool,
    jobs: int | None,
    json_path: Path | None,
    page_path: Path | None,
) -> int:
    """Break a simulated bench in every known way and judge what comes of it.

    In lockstep the board and the daemon's control task run on virtual time; faults of the host
    are tried on a real daemon process. Exit status 1 if anything breaks the oracle.
    """
    began_s = time.monotonic()
    results: list[Judged] = []
    both = lockstep == process
    host_faults, rows = _chosen(only, with_lockstep=both or lockstep, with_process=both or process)
    if rows:
        wanted = pairs if pairs is not None else 0 if only else count // _PAIRS_A_COUNT
        results += _lockstep(seed, count, wanted, rows, jobs)
    results += _process(seed, host_faults)
    run = report.CampaignRun(
        seed=seed,
        when=f"{datetime.now(UTC):%Y-%m-%d %H:%M} UTC",
        took_s=time.monotonic() - began_s,
        command=_described(click.get_current_context().params),
        results=tuple(results),
    )
    print_table(report.table_of(report.by_fault(run.results)))
    print_table(report.table_of(report.by_group(run.results)))
    _write(report.json_of(run), json_path)
    if page_path is not None:
        write_page(report.page_of(run), page_path)
    for line in report.failure_lines(run):
        click.echo(f"FAILED {line}")
    click.echo(report.verdict(run))
    return 1 if run.failures else 0


@root.command()
@click.option("--seconds", type=Quantity("s", 20.0), metavar="S", help="Board time of each stage.")
@click.option("--rate", type=click.Choice(["100", "500"]), help="Only the stage at this rate.")
@click.option(
    "--every", type=Quantity("s", 5.0), metavar="S", help="Board time between reconnects."
)
@click.option("--seed", type=Whole(0, 2**32 - 1), default=1, show_default=True)
@click.option("--json", "json_path", type=click.Path(path_type=Path), metavar="FILE")
def soak(
    *,
    seconds: float | None,
    rate: str | None,
    every: float | None,
    seed: int,
    json_path: Path | None,
) -> int:
    """Run a daemon for an hour of board time at 100 Hz and ten minutes at 500 Hz.

    Random commands, a reconnect every minute, a slow subscriber, floods of commands; as fast as
    the machine allows. Exit status 1 if a sample is lost, something grows, or a command is not
    logged.
    """
    chosen = [stage for stage in FULL if rate is None or stage.rate_hz == int(rate)]
    if seconds is not None:
        chosen = [replace(stage, seconds=seconds) for stage in chosen]
    if every is not None:
        chosen = [replace(s, reconnect_every_s=every, flood_every_s=every) for s in chosen]
    with ended_by_signals(), progress() as line:
        results = [run_stage(stage, seed, line.say) for stage in chosen]
        line.done()
    for result in results:
        click.echo(soak_report.facts(result))
        print_table(soak_report.table_of(result))
        for command in result.not_logged[:_SHOWN]:
            click.echo(f"NOT LOGGED {command}")
    _write(soak_report.json_of(results), json_path)
    ok = all(check.ok for result in results for check in soak_report.checks(result))
    click.echo("every check holds" if ok else "a check FAILED")
    return 0 if ok else 1


@root.command()
@click.option(
    "--connections",
    type=Whole(1, 60_000),
    default=10_000,
    show_default=True,
    help="How many are opened at once in the last attack.",
)
@click.option("--messages", type=Whole(1), default=10_000, show_default=True)
@click.option("--json", "json_path", type=click.Path(path_type=Path), metavar="FILE")
def hostile(*, connections: int, messages: int, json_path: Path | None) -> int:
    """Attack a daemon that moves a simulated bench in real time.

    Strangers' keys, replayed, malformed and huge messages, a crowd of connections. Exit status 1
    if one is carried out or not told, costs a sample, or leaves something behind.
    """
    scale = Scale(messages=messages, connections=connections)
    with ended_by_signals(), progress() as line:
        results = attacks.run_attacks(scale, line.say)
        line.done()
    print_table(attacks.table_of(results))
    _write(attacks.json_of(results), json_path)
    ok = not any(result.failures for result in results)
    click.echo("the daemon stood every attack" if ok else "an attack did harm")
    return 0 if ok else 1


@root.command()
@click.option(
    "--hours",
    type=Quantity(low=0.05, high=24.0),
    default=8.0,
    show_default=True,
    help="Of board time.",
)
@click.option(
    "--speed",
    type=Quantity(low=1.0, high=50.0),
    default=50.0,
    show_default=True,
    help="Board time over wall time at most.",
)
@click.option(
    "--wall-hours",
    type=Quantity(low=0.01),
    default=24.0,
    show_default=True,
    help="End early after so long by the wall clock.",
)
@click.option("--troubles", type=Whole(0, 1000), help="So many  [default: two an hour]")
@click.option("--seed", type=Whole(0, 2**32 - 1), default=1, show_default=True)
@click.option(
    "--folder",
    type=click.Path(file_okay=False, path_type=Path),
    required=True,
    help="A new one; queue, run logs, words and health.html stay there.",
)
def night(
    *, hours: float, speed: float, wall_hours: float, troubles: int | None, seed: int, folder: Path
) -> int:
    """Let a queue work for a night of board time while parts of it are killed.

    Moves and endurance runs; cables pulled, stops, kills, power losses; a person who comes a minute
    after each pause. Prints troubles, messages and health, and what a week takes by the slopes of
    memory and disk. Exit status 1 if something ran twice, a word was late, the bench stayed armed
    without an item, or a run log was lost.
    """
    from campaign.night import report as night_report
    from campaign.night.run import NightOptions, run_night

    if folder.exists() and any(folder.iterdir()):
        raise CommandError("the folder is not empty", value=str(folder), action="name a new one")
    asked = NightOptions(
        hours=hours,
        seed=seed,
        speed=speed,
        longest_h=wall_hours,
        troubles=max(1, round(2.0 * hours)) if troubles is None else troubles,
    )
    with ended_by_signals(), progress() as line:
        night = run_night(folder.absolute(), asked, line.say)
        line.done()
    _show_night(folder)
    if night.met:
        print_table(night_report.troubles_table(night))
    print_table(night_report.week_table(night))
    click.echo(night_report.facts(night))
    for text in night.failures:
        click.echo(f"FAILED {text}")
    click.echo("a check FAILED" if night.failures else "every check holds")
    return 1 if night.failures else 0


def _show_night(folder: Path) -> None:
    """Print queue, messages and health as a user sees them."""
    for words in (
        ["queue", "list", "--all"],
        ["queue", "messages"],
        ["health", "--report", str(folder / "health.html")],
    ):
        click.echo(f"$ smad {' '.join(words)}")
        run_group(smad_root, [*words, "--folder", str(folder / "runs")], "smad")


root.add_command(fuzz)


def _chosen(
    only: tuple[str, ...], *, with_lockstep: bool, with_process: bool
) -> tuple[list[str], list[str]]:
    """Names for the process campaign and for the lockstep campaign. Raises CommandError."""
    host = list(HOST_FAULTS) if with_process else []
    device = {row.name: row.kind.name for row in ROWS.values()} if with_lockstep else {}
    known = {*host, *device, *device.values()}
    for name in only:
        if name not in known:
            raise CommandError(
                "there is no such fault in the campaign",
                value=name,
                action=instead(name, sorted(known), "smad sim --help says how to inject by hand"),
            )
    wanted = known if not only else set(only)
    return (
        [name for name in host if name in wanted],
        [name for name, kind in device.items() if name in wanted or kind in wanted],
    )


def _lockstep(
    seed: int, count: int, pairs: int, names: list[str], jobs: int | None
) -> list[Judged]:
    cases = single_cases(seed, count, chosen_rows(names)) + pair_cases(seed, pairs)
    results = []
    with progress() as line:
        for outcome in outcomes(cases, jobs):
            results.append(judged(outcome))
            bad = sum(1 for result in results if result.violations)
            line.say(f"lockstep: {len(results)} of {len(cases)}, {bad} broke the oracle")
        line.done()
    return results


def _process(seed: int, names: list[str]) -> list[Judged]:
    results = []
    with progress() as line:
        for n, name in enumerate(names):
            line.say(f"process: {name}, {n + 1} of {len(names)}")
            results.append(judged(run_host_fault(HOST_FAULTS[name], seed)))
        line.done()
    return results


def _described(params: dict[str, object]) -> str:
    """The options that say what was run, as they are typed."""
    words = ["python -m campaign faults", f"--seed {params['seed']}", f"--count {params['count']}"]
    if params["pairs"] is not None:
        words.append(f"--pairs {params['pairs']}")
    only = params["only"]
    words += [f"--only {name}" for name in only] if isinstance(only, tuple) else []
    words += [f"--{flag}" for flag in ("lockstep", "process") if params[flag]]
    return " ".join(words)


def _write(text: str, path: Path | None) -> None:
    if path is None:
        return
    try:
        path.write_text(text)
    except OSError as error:
        raise CommandError(
            f"the results cannot be written ({error.strerror})",
            value=str(path),
            action="choose another file with --json",
        ) from None
