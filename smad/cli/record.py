"""`smad record`: begin, end and annotate a run log."""

import click

from smad.cli.options import Group, argument, bench_option, option
from smad.cli.output import client
from smad.cli.quantity import Quantity
from smad.counted import counted
from smad.files import display_path


@click.group(cls=Group)
def record() -> None:
    """Record a run. Arming starts a recording, unless the configuration says otherwise."""


@record.command()
def start(name: str = argument(default=""), bench: str = bench_option) -> None:
    """Begin a run log; NAME goes into the file's name.

    Without NAME, the log that arming started continues. With NAME, it ends and a new one begins.
    """
    with client(bench) as bench_client:
        status = bench_client.start_recording(name)
    click.echo(f"recording to {display_path(status.path)}")


@record.command()
def stop(bench: str = bench_option) -> None:
    """Close the run log."""
    with client(bench) as bench_client:
        status = bench_client.stop_recording()
    lost = f", {counted(status.dropped, 'sample')} lost" if status.dropped else ""
    click.echo(f"{display_path(status.path)}: {counted(status.rows, 'sample')}{lost}")
    if status.error:
        click.echo(f"smad: {status.error}", err=True)
        raise SystemExit(1)


@record.command()
def last(
    seconds: float = option("--seconds", "How far back.", Quantity("s", 1.0, 600.0), default=60.0),
    bench: str = bench_option,
) -> None:
    """Write the last seconds into a log, recorded or not.

    After a fault the daemon does this by itself.

    The daemon keeps the last minute of every channel and event in memory (recorder.black_box_s).
    """
    with client(bench) as bench_client:
        status = bench_client.record_last(seconds)
    click.echo(f"the last {seconds:g} s: {display_path(status.last)}")


@record.command()
def note(text: str = argument(), bench: str = bench_option) -> None:
    """Write TEXT into the run log."""
    with client(bench) as bench_client:
        bench_client.note(text)
    click.echo("noted")
