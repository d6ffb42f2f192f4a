"""`python -m tests.fuzz [TARGET…]`: fuzz, print what was done and what was found.

Ends with status 1 when something was found. `--keep` adds what reached something new to the corpus.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path

from tests.fuzz.blind import fuzz_blindly
from tests.fuzz.corpus import write_corpus
from tests.fuzz.engine import EngineError, available, fuzz, least
from tests.fuzz.outcome import Finding, Outcome
from tests.fuzz.targets import TARGETS, Target

_SECONDS = 60
_COLUMNS = ("target", "executions", "s", "per s", "edges", "of", "new", "inputs", "MiB", "findings")
_LARGEST_KEPT_BYTES = 8192
_MOST_KEPT_BYTES = 35_000
_MOST_KEPT_INPUTS = 150


def main(arguments: Sequence[str] | None = None) -> int:
    """Fuzz the targets named, or all, one after the other."""
    options = _options(arguments)
    guided = available() and not options.blind
    if not guided:
        sys.stderr.write("without atheris: mutations are not guided by coverage\n")
    runs = options.runs
    seconds = None if runs is not None and options.seconds is None else options.seconds or _SECONDS
    outcomes = []
    _print(_COLUMNS)
    for name in options.targets or TARGETS:
        target = TARGETS[name]
        try:
            run = fuzz if guided else fuzz_blindly
            outcome = run(target, seconds=seconds, runs=runs, seed=options.seed)
        except EngineError as error:
            sys.stderr.write(f"{error}\n")
            return 2
        outcomes.append(outcome)
        _print(_cells(outcome))
        for finding in outcome.findings:
            _tell(finding, name, options.findings)
        if options.keep and guided:
            _keep(target, outcome.grown)
    if options.json:
        options.json.write_text(json.dumps([_plain(outcome) for outcome in outcomes], indent=1))
    return int(any(outcome.findings for outcome in outcomes))


def _options(arguments: Sequence[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m tests.fuzz", description=main.__doc__)
    parser.add_argument(
        "targets", nargs="*", choices=[*TARGETS, []], metavar="TARGET", help=", ".join(TARGETS)
    )
    parser.add_argument("--seconds", type=int, help=f"for each target; {_SECONDS} by default")
    parser.add_argument("--runs", type=int, help="inputs for each target")
    parser.add_argument("--seed", type=int, default=1, help="of the mutations")
    parser.add_argument("--blind", action="store_true", help="do without atheris")
    parser.add_argument("--json", type=Path, help="write the results to this file")
    parser.add_argument("--keep", action="store_true", help="add what is new to the corpus")
    parser.add_argument(
        "--findings", type=Path, default=Path("findings"), help="folder for what breaks a promise"
    )
    return parser.parse_args(arguments)


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


def _tell(finding: Finding, target: str, folder: Path) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / f"{target}-{hashlib.sha256(finding.data).hexdigest()[:12]}"
    path.write_bytes(finding.data)
    path.with_suffix(".txt").write_text(finding.text)
    sys.stdout.write(f"  {finding.kind}: {path} ({len(finding.data)} bytes)\n")


def _keep(target: Target, grown: tuple[bytes, ...]) -> None:
    """Keep the least that reaches everything, or what there is room for of it.

    What was seeded or once found always stays.
    """
    kept = target.corpus()
    always = {name: data for name, data in kept.items() if _is_named(name)}
    small = [data for data in grown if len(data) <= _LARGEST_KEPT_BYTES]
    chosen = least(target, (*always.values(), *small, *kept.values()))
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


if __name__ == "__main__":
    sys.exit(main())
