"""`smad move`: trajectories of the displacement loop."""

from __future__ import annotations

import csv
import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from smad.cli.output import NEGATIVE, bench_option, client, wait_for_motion
from smad.control.segment import millimetres
from smad.errors import CommandError

if TYPE_CHECKING:
    from smad.control.commands import Samples, Trajectory

TIME_COLUMN = "t_s"
DISPLACEMENT_COLUMN = "displacement_mm"
ANGLE_COLUMN = "angle_deg"


def _unit_mm(context: click.Context, parameter: click.Parameter, degrees: bool) -> float:
    """Millimetres to one unit of the lengths on the command line."""
    return millimetres(1.0) if degrees else 1.0


_degrees = click.option(
    "--deg",
    "unit_mm",
    is_flag=True,
    callback=_unit_mm,
    help="Lengths are angles of the MINIR-II segment: degrees for MM (25 degrees are 4 mm).",
)


def _options(command: Any) -> Any:
    for option in (
        click.option("--queue", is_flag=True, help="Append to what runs instead of replacing it."),
        click.option(
            "--wait/--no-wait", default=True, help="Wait until it is done, or return at once."
        ),
        bench_option,
    ):
        command = option(command)
    return command


@click.group()
def move() -> None:
    """Move the pair along a trajectory. Positive displacement: spring X pulls."""


@move.command(context_settings=NEGATIVE)
@click.argument("place", type=float, metavar="MM")
@click.option("--for", "duration_s", type=float, default=10.0, show_default=True, metavar="S")
@_degrees
@_options
def step(place: float, duration_s: float, unit_mm: float, **options: Any) -> None:
    """Jump to MM and stay there."""
    from smad.control.commands import Step

    _send(Step(displacement_mm=place * unit_mm, duration_s=duration_s), **options)


@move.command(context_settings=NEGATIVE)
@click.argument("duration_s", type=float, metavar="S")
@_options
def hold(duration_s: float, **options: Any) -> None:
    """Stay where the reference is for S seconds."""
    from smad.control.commands import Hold

    _send(Hold(duration_s=duration_s), **options)


@move.command(context_settings=NEGATIVE)
@click.argument("place", type=float, metavar="MM")
@click.option("--rate", type=float, default=2.0, show_default=True, metavar="MM/S")
@_degrees
@_options
def ramp(place: float, rate: float, unit_mm: float, **options: Any) -> None:
    """Go to MM at a constant speed."""
    from smad.control.commands import Ramp

    _send(Ramp(displacement_mm=place * unit_mm, rate_mm_per_s=rate * unit_mm), **options)


@move.command(context_settings=NEGATIVE)
@click.argument("amplitude", type=float, metavar="MM")
@click.argument("period_s", type=float, metavar="S")
@click.option("--cycles", type=int, default=3, show_default=True)
@click.option("--offset", type=float, default=0.0, show_default=True, metavar="MM")
@_degrees
@_options
def sine(
    amplitude: float,
    period_s: float,
    cycles: int,
    offset: float,
    unit_mm: float,
    **options: Any,
) -> None:
    """A sinusoid of amplitude MM and period S."""
    from smad.control.commands import Sine

    _send(
        Sine(
            amplitude_mm=amplitude * unit_mm,
            period_s=period_s,
            cycles=cycles,
            offset_mm=offset * unit_mm,
        ),
        **options,
    )


@move.command(context_settings=NEGATIVE)
@click.argument("amplitude", type=float, metavar="MM")
@click.argument("start_hz", type=float, metavar="HZ")
@click.argument("end_hz", type=float, metavar="HZ")
@click.option("--for", "duration_s", type=float, default=60.0, show_default=True, metavar="S")
@click.option("--offset", type=float, default=0.0, show_default=True, metavar="MM")
@_degrees
@_options
def chirp(
    amplitude: float,
    start_hz: float,
    end_hz: float,
    duration_s: float,
    offset: float,
    *,
    unit_mm: float,
    **options: Any,
) -> None:
    """A sinusoid of amplitude MM whose frequency goes from HZ to HZ."""
    from smad.control.commands import Chirp

    _send(
        Chirp(
            amplitude_mm=amplitude * unit_mm,
            start_Hz=start_hz,
            end_Hz=end_hz,
            duration_s=duration_s,
            offset_mm=offset * unit_mm,
        ),
        **options,
    )


@move.command(context_settings=NEGATIVE)
@click.argument("height", type=float, metavar="MM")
@click.argument("steps", type=int)
@click.option("--dwell", type=float, default=10.0, show_default=True, metavar="S")
@click.option("--back", is_flag=True, help="Return the same way.")
@_degrees
@_options
def staircase(
    height: float, steps: int, dwell: float, back: bool, unit_mm: float, **options: Any
) -> None:
    """STEPS equal steps of MM each."""
    from smad.control.commands import Staircase

    _send(
        Staircase(step_mm=height * unit_mm, steps=steps, dwell_s=dwell, there_and_back=back),
        **options,
    )


@move.command(context_settings=NEGATIVE)
@click.argument("amplitude", type=float, metavar="MM")
@click.argument("levels", type=int)
@click.option("--dwell", type=float, default=10.0, show_default=True, metavar="S")
@click.option("--seed", type=int, default=0, show_default=True)
@_degrees
@_options
def random(
    amplitude: float, levels: int, dwell: float, seed: int, unit_mm: float, **options: Any
) -> None:
    """LEVELS random levels within ±MM; the same seed gives the same levels."""
    from smad.control.commands import RandomLevels

    _send(
        RandomLevels(amplitude_mm=amplitude * unit_mm, levels=levels, dwell_s=dwell, seed=seed),
        **options,
    )


@move.command(context_settings=NEGATIVE)
@click.argument("path", type=click.Path(path_type=Path))
@_options
def follow(path: Path, **options: Any) -> None:
    """Follow the points of a CSV file with the columns t_s and displacement_mm.

    A file with angle_deg in place of displacement_mm is followed as angles of the segment.
    """
    _send(read_samples(path), **options)


def read_samples(path: Path) -> Samples:
    """Return the points of a CSV file, times shifted to begin at 0. Raises CommandError."""
    from smad.control.commands import Samples

    times: list[float] = []
    places: list[float] = []
    try:
        with path.open(newline="") as file:
            rows = csv.DictReader(file)
            columns = set(rows.fieldnames or ())
            angles = ANGLE_COLUMN in columns and DISPLACEMENT_COLUMN not in columns
            place = ANGLE_COLUMN if angles else DISPLACEMENT_COLUMN
            if not {TIME_COLUMN, place} <= columns:
                raise CommandError(
                    f"{path}: a column is missing",
                    value=", ".join(rows.fieldnames or ()) or "an empty file",
                    limit=f"{TIME_COLUMN}, and {DISPLACEMENT_COLUMN} or {ANGLE_COLUMN}",
                    action="name the columns so, in the first line",
                )
            for row in rows:
                times.append(_number(path, rows.line_num, TIME_COLUMN, row))
                value = _number(path, rows.line_num, place, row)
                places.append(millimetres(value) if angles else value)
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        reason = error.strerror if isinstance(error, OSError) else str(error)
        raise CommandError(f"cannot read {path}: {reason}", action="give a CSV file") from error
    if len(times) < 2:
        raise CommandError(
            f"{path}: too few points", value=len(times), limit="at least 2", action="add points"
        )
    start_s = times[0]
    return Samples(t_s=tuple(t - start_s for t in times), displacement_mm=tuple(places))


def _number(path: Path, line: int, column: str, row: dict[str, Any]) -> float:
    try:
        value = float(row[column])
    except (TypeError, ValueError):
        value = math.nan
    if not math.isfinite(value):
        raise CommandError(
            f"{path}, line {line}: {column} is not a number",
            value=str(row[column]),
            action="correct the line",
        )
    return value


def _send(trajectory: Trajectory, *, queue: bool, wait: bool, bench: str) -> None:
    with client(bench) as bench_client:
        bench_client.move(trajectory, queue=queue)
        what = type(trajectory).__name__.lower()
        wait_for_motion(bench_client, wait=wait and not queue, what=what)
