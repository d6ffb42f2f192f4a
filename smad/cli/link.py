"""`smad link`: how well the line to the board works."""

import time

import click

from smad.api import Status
from smad.cli.options import Group, axis_option, option
from smad.cli.output import client, progress
from smad.cli.quantity import Quantity
from smad.counted import counted
from smad.errors import PortError
from smad.view.terminal.status_lines import spread

_ERRORS = ("crc_errors", "cobs_errors", "length_errors", "payload_errors")


@click.group(cls=Group)
def link() -> None:
    """Test the serial link."""


@link.command("test")
def count(
    duration_s: float = option(
        "--for", Quantity("s", 0.01, 3600.0), "Seconds to count.", default=5.0
    ),
    bench: str = axis_option,
) -> None:
    """Count samples, errors and delays for some seconds.

    The exit status is 1 if a sample was lost.
    """
    with client(bench) as bench_client, progress() as line:
        bench_client.reset_timing()
        before = bench_client.status()
        began_s = time.monotonic()
        deadline = began_s + duration_s
        while (left := deadline - time.monotonic()) > 0:
            line.say(f"testing the link, {left:.0f} s to go")
            time.sleep(min(0.5, left))
        # The percentiles are worked out once a second.
        time.sleep(1.1)
        after = bench_client.status()
        took_s = time.monotonic() - began_s
    samples = after.counts.samples - before.counts.samples
    if samples == 0:
        raise PortError(
            "no sample came",
            value=f"link is {after.link.state}",
            limit=f"{after.link.rate_hz * took_s:.0f} in {took_s:.1f} s",
            action="check cable and power of the board; smad status says more",
        )
    lost = _report(before, after, samples, took_s)
    if lost:
        raise PortError(
            "the link is not clean",
            value=f"{lost} lost of {counted(samples, 'sample')}",
            limit="0",
            action="try another cable or USB port, or a lower rate; see smad docs guide/daemon",
        )


def _report(before: Status, after: Status, samples: int, took_s: float) -> int:
    counts, earlier = after.counts, before.counts
    missed = counts.missed - earlier.missed
    skipped = counts.skipped - earlier.skipped
    refused = counts.setpoints_dropped - earlier.setpoints_dropped
    damaged = sum(
        after.link.frames.get(name, 0) - before.link.frames.get(name, 0) for name in _ERRORS
    )
    age, share = after.timing.setpoint_age, after.timing.own_share
    click.echo(
        f"samples       {samples} in {took_s:.1f} s (asked for {after.link.rate_hz} a second)"
    )
    click.echo(f"missed        {missed}")
    click.echo(f"skipped       {skipped} (a newer one was there already)")
    click.echo(f"damaged       {counted(damaged, 'frame')} from the board")
    click.echo(f"not written   {counted(refused, 'setpoint')}")
    too_old = counts.setpoints_refused - earlier.setpoints_refused
    click.echo(f"refused       {counted(too_old, 'setpoint')}, too old for the board")
    click.echo(f"setpoint age  {spread(age)}")
    click.echo(f"host share    {spread(share)}")
    return missed + damaged + refused
