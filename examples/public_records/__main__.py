"""What the diagnosis says of public records of other systems: python -m examples.public_records."""

from __future__ import annotations

import time
from pathlib import Path

import click

from examples.public_records.records import RECORDS, RecordError
from smad.diagnosis.report.page import write_report
from smad.diagnosis.report.words import lines


@click.command()
@click.argument("name", type=click.Choice(list(RECORDS)))
@click.option(
    "--folder",
    type=click.Path(path_type=Path),
    default=Path("public-records"),
    help="Where the file is, or is put when it has been fetched.",
)
@click.option("--report", type=click.Path(path_type=Path), help="Write the report there.")
@click.option("--exchange", is_flag=True, help="Fit the runs to judge on, and the other way round.")
def main(name: str, folder: Path, report: Path | None, exchange: bool) -> None:
    """Diagnose a public record whose cause is published, and print the verdict."""
    record = RECORDS[name]
    try:
        asked = record.asked(folder)
    except RecordError as error:
        raise click.ClickException(str(error)) from error
    if exchange and not asked.hold_out:
        raise click.UsageError(f"{name} has no runs to judge on beside; leave --exchange out")
    fit, held = (asked.hold_out, asked.fit) if exchange else (asked.fit, asked.hold_out)
    answer = record.diagnosed(fit, held)
    click.echo("\n".join(lines(answer.verdict)))
    click.echo(f"{time.process_time():.0f} s of processor time")
    if report is not None:
        write_report(answer, report)


if __name__ == "__main__":
    main()
