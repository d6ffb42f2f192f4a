"""`python -m campaign fuzz [TARGET…]`: fuzz, print what was done and what was found.

Ends with status 1 when something was found. `--keep` adds what reached something new to the corpus.
"""

from __future__ import annotations

import hashlib
import json
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path

import click

from campaign.fuzz.blind import fuzz_blindly
from campaign.fuzz.corpus import write_corpus
from campaign.fuzz.engine import EngineError, available, least
from campaign.fuzz.engine import fuzz as engine_fuzz
from campaign.fuzz.outcome import Finding, Outcome
from campaign.fuzz.targets import TARGETS, Target

_SECONDS = 60
_COLUMNS = ("target", "executions", "s", "per s", "edges", "of", "new", "inputs", "MiB", "findings")
_LARGEST_KEPT_BYTES = 8192
_MOST_KEPT_BYTES = 35_000
_MOST_KEPT_INPUTS = 150


@click.command()
@click.argument("targets", nargs=-1, type=click.Choice(list(TARGETS)), metavar="[TARGET]...")
@click.option(
    "--seconds", type=click.IntRange(1), help=f"For each target; {_SECONDS} unless --runs is given."
)
@click.option("--runs", type=click.IntRange(1), help="Inputs for each target.")
@click.option("--seed", type=click.IntRange(0), default=1, show_default=True, help="Of mutations.")
@click.option("--blind", is_flag=True, help="Do without atheris.")
@click.option("--json", "json_path", type=click.Path(path_type=Path), metavar="FILE")
@click.option("--keep", is_flag=True, help="Add inputs that reach something new to the corpus.")
@click.option(
    "--findings",
    type=click.Path(path_type=Path),
    default="findings",
    show_default=True,
    help="Folder for inputs that cause a defect.",
)
def fuzz(
    *,
    targets: tuple[str, ...],
    seconds: int | None,
    runs: int | None,
    seed: int,
    blind: bool,
    json_path: Path | None,
    keep: bool,
    findings: Path,
) -> int:
    """Fuzz each TARGET, or all, one after the other.

    Exit status 1 if an input causes a defect, 2 if the fuzzer itself fails.
    """
    guided = available() and not blind
    if not guided:
        click.echo("without atheris: mutations are not guided by coverage", err=True)
    if runs is None and seconds is None:
        seconds = _SECONDS
    outcomes = []
    _print(_COLUMNS)
    for name in targets or TARGETS:
        target = TARGETS[name]
        try:
            run = engine_fuzz if guided else fuzz_blindly
            outcome = run(target, seconds=seconds, runs=runs, seed=seed)
        except EngineError as error:
            click.echo(str(error), err=True)
            return 2
        outcomes.append(outcome)
        _print(_cells(outcome))
        for finding in outcome.findings:
            _write_finding(finding, name, findings)
        if keep and guided:
            _keep(target, outcome.grown)
    if json_path:
        json_path.write_text(json.dumps([_plain(outcome) for outcome in outcomes], indent=1))
    return int(any(outcome.findings for outcome in outcomes))


def _cells(outcome: Outcome) -> tuple[object, ...]:
    rate = outcome.executions / outcome.seconds if outcome.seconds else 0
    return (
        outcome.target,
        outcome.executions,
        f"{outcome.seconds:.0f}",
        f"{rate:.0f}",
        outcome.edges,
        outcome.counters,
        outcome.edges - outcome.edges_before,
        f"{outcome.inputs_before}→{outcome.inputs}",
        outcome.peak_MiB,
        len(outcome.findings),
    )


def _print(cells: Sequence[object]) -> None:
    widths = (11, 11, 5, 7, 6, 6, 5, 11, 5, 9)
    texts = [
        str(cell).ljust(width) if number == 0 else str(cell).rjust(width)
        for number, (cell, width) in enumerate(zip(cells, widths, strict=True))
    ]
    sys.stdout.write(" ".join(texts).rstrip() + "\n")
    sys.stdout.flush()


def _write_finding(finding: Finding, target: str, folder: Path) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / f"{target}-{hashlib.sha256(finding.data).hexdigest()[:12]}"
    path.write_bytes(finding.data)
    path.with_suffix(".txt").write_text(finding.text)
    sys.stdout.write(f"  {finding.kind}: {path} ({len(finding.data)} bytes)\n")


def _keep(target: Target, grown: tuple[bytes, ...]) -> None:
    """Keep the least that reaches everything, or what there is room for of it.

    What was seeded or once found always stays.
    """
    corpus = target.corpus()
    always = {name: data for name, data in corpus.items() if _is_named(name)}
    small = [data for data in grown if len(data) <= _LARGEST_KEPT_BYTES]
    chosen = least(target, (*always.values(), *small, *corpus.values()))
    added = sorted(set(chosen) - set(always.values()), key=lambda data: (len(data), data))
    new = {hashlib.sha256(data).hexdigest()[:16]: data for data in _spread(added)}
    write_corpus(target.archive, always | new)


def _spread(inputs: Sequence[bytes]) -> Iterator[bytes]:
    """Yield as many as there is room for, from the short to the long ones: both reach their own."""
    step = max(1.0, len(inputs) / _MOST_KEPT_INPUTS, sum(map(len, inputs)) / _MOST_KEPT_BYTES)
    for number in range(int(len(inputs) / step)):
        yield inputs[int(number * step)]


def _is_named(name: str) -> bool:
    return name.startswith(("seed-", "found-"))


def _plain(outcome: Outcome) -> dict[str, object]:
    plain: dict[str, object] = {
        name: getattr(outcome, name)
        for name in Outcome.__dataclass_fields__
        if name not in ("findings", "grown")
    }
    plain["findings"] = [finding.kind for finding in outcome.findings]
    return plain
