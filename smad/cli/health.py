"""`smad health`: the record of a bench, its trends, and what they will come to."""

from collections.abc import Mapping
from pathlib import Path

import click

from smad.cli.options import FILE, FOLDER, OUTPUT, Command, json_option, option
from smad.cli.output import print_json
from smad.cli.quantity import Quantity
from smad.view.terminal.progress import progress


@click.command(cls=Command)
def health(
    *,
    folder: Path = option(
        "--folder",
        "Folder of the run logs; health.jsonl is kept there.",
        FOLDER,
        default=Path("runs"),
    ),
    verdicts: tuple[Path, ...] = option(
        "--verdict", "Add a check-up: the JSON that it wrote; may be repeated.", FILE, multiple=True
    ),
    limits: tuple[str, ...] = option(
        "--limit NAME=VALUE",
        "Predict the cycles to a limit, such as stroke_mm=8; may be repeated.",
        multiple=True,
    ),
    report: Path | None = option("--report", "Write one page with all trends here.", OUTPUT),
    as_json: bool = json_option,
) -> None:
    """Show how the bench ages, from its run logs and check-ups.

    It first adds the new runs of FOLDER to the record. Each run log gives a row with stroke, rest,
    force, resistances, cooling and gains; each check-up gives its parameters with intervals, floors
    and places. It compares runs of the same name. It reports a change when the cumulative sum of
    deviations leaves the range of the first ten rows.
    """
    from smad.experiments.ready import require_packages
    from smad.health.collect import collect
    from smad.health.report import headline, health_of, page, table
    from smad.report.page import write_page

    require_packages("report" if report else "sim")
    most = _limits(limits)
    with progress() as line:
        rows = collect(folder, verdicts, say=line.note, progress=line.say)
    bench_health = health_of(rows, most)
    for name in set(most) - {n for r in rows for q in r.values for n in (q, f"{r.group}: {q}")}:
        click.echo(f"smad: no row has the quantity of --limit {name}", err=True)
    if report is not None:
        write_page(page(bench_health, str(folder)), report)
    if as_json:
        print_json(bench_health.record(), indent=-1)
        return
    click.echo(headline(bench_health))
    if bench_health.trends:
        from smad.view.terminal.tables import print_table

        print_table(table(bench_health))
    if report is not None:
        click.echo(report)


def _limits(texts: tuple[str, ...]) -> Mapping[str, float]:
    limits = {}
    for text in texts:
        name, equals, value = text.rpartition("=")
        if not (name and equals):
            raise click.UsageError(f"--limit {text}: give NAME=VALUE, such as stroke_mm=8")
        limits[name] = Quantity().convert(value, None, click.get_current_context())
    return limits
