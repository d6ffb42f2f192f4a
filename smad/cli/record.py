"""`smad record`: begin, end and annotate a run log."""

import click

from smad.cli.output import bench_option, client
from smad.cli.quantity import Quantity
from smad.counted import counted
from smad.files import display_path


@click.group()
def record() -> None:
    """Record a run. Arming starts a recording, unless the configuration says otherwise."""


@record.command()
@click.argument("name", default="")
@bench_option
def start(name: str, bench: str) -> None:
    """Begin a run log; NAME goes into the file's name.

    Without NAME, the log that arming started continues. With NAME, it ends and a new one begins.
    """
    with client(bench) as bench_client:
        status = bench_client.start_recording(name)
    click.echo(f"recording to {display_path(status.path)}")


@record.command()
@bench_option
def stop(bench: str) -> None:
    """Close the run log."""
    with client(bench) as bench_client:
        status = bench_client.stop_recording()
    lost = f", {counted(status.dropped, 'sample')} lost" if status.dropped else ""
    click.echo(f"{display_path(status.path)}: {counted(status.rows, 'sample')}{lost}")
    if status.error:
        click.echo(f"smad: {status.error}", err=True)
        raise SystemExit(1)


@record.command()
@click.option("--seconds", type=Quantity("s"), default=60.0, help="How far back.")
@bench_option
def last(seconds: float, bench: str) -> None:
    """Write the last seconds into a log, recorded or not.

    After a fault this happens by itself.

    The daemon keeps the last minute of every channel and event in memory (recorder.black_box_s).
    """
    with client(bench) as bench_client:
        status = bench_client.record_last(seconds)
    click.echo(f"the last {seconds:g} s: {display_path(status.last)}")


@record.command()
@click.argument("text")
@bench_option
def note(text: str, bench: str) -> None:
    """Write TEXT into the run log."""
    with client(bench) as bench_client:
        bench_client.note(text)
    click.echo("noted")
