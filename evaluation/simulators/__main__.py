"""`python -m evaluation.simulators`: four plants side by side, and the rating against findings."""

from __future__ import annotations

import tempfile
from pathlib import Path

import click


@click.group()
def main() -> None:
    """Simulators of others, tried on simulated benches."""


@main.command(name="side-by-side")
@click.option("--plant", "plants", multiple=True, help="Only this one: function, MuJoCo, FMU …")
def side_by_side(*, plants: tuple[str, ...]) -> None:
    """One pendulum with a hidden friction as function, MuJoCo model, FMU and own class."""
    from evaluation.simulators.side_by_side import side_by_side as asked
    from evaluation.simulators.side_by_side import table_of

    with tempfile.TemporaryDirectory() as folder:
        click.echo("\n".join(table_of(asked(Path(folder), plants))))


@main.command()
@click.option("--cases", "count", type=click.IntRange(1), default=40, show_default=True)
@click.option("--seed", type=click.IntRange(0), default=0, show_default=True)
@click.option("--plant", default="mixing tank", show_default=True, help="Or: heater.")
def rating(*, count: int, seed: int, plant: str) -> None:
    """Rate causes by inputs, simulate them, and count what is found."""
    from evaluation.simulators.plants import PLANTS
    from evaluation.simulators.rated import cases, shares

    if plant not in PLANTS:
        raise click.BadParameter(f"{plant!r} is none of {', '.join(PLANTS)}", param_hint="--plant")
    tried = list(cases(PLANTS[plant], count, seed, lambda text: click.echo(text, err=True)))
    click.echo("\n".join(shares(tried)))


if __name__ == "__main__":
    main()
