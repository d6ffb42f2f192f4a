"""Constants of the check-up from a development bank, and how reliable they are before and after."""

import json
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import msgspec

from smad.gap.check.names import canonical
from smad.gap.paired.calibrate import (
    FORMS,
    Known,
    Truth,
    examined,
    examined_again,
    left_out,
    quiet_limits,
    reliability,
    reliability_lines,
    reliability_of,
    tried,
)
from smad.gap.paired.constants import Constants, shipped_constants
from smad.gap.paired.difference import paired
from smad.gap.paired.spring_pair import TRAITS
from smad.gap.sma import SmaPlant
from tests.withheld.check_up import benches_of, manifest_of
from tests.withheld.errors import BankError

_KINDS = {"none": "quiet", "parameters": "parameters", "unknown": "unknown"}


def truth_of(entry: dict[str, Any], library: dict[str, str]) -> Truth:
    """The truth of a key's entry in the library's names; an effect it lacks is unknown."""
    kind = _KINDS.get(entry["kind"], "effects")
    if kind != "effects":
        return Truth(kind)
    names = frozenset(library[canonical(e["name"])] for e in entry["effects"])
    return Truth(kind, names)


def known_cases(bank: Path, key: Path, only: Sequence[str] = ()) -> Iterator[Known]:
    """The check-ups of a bank with their truth, bench by bench."""
    manifest = manifest_of(bank)
    entries = json.loads((key / "KEY.json").read_text())["cases"]
    if "sealed" in str(manifest["bank"]):
        raise BankError(f"{bank} is sealed: constants come from development banks")
    plant = SmaPlant()
    library = {canonical(e.name): e.name for e in plant.effects}
    for bench, reference, cases in benches_of(bank, manifest, plant, only=only):
        for case, runs in cases:
            pairs = paired(plant, TRAITS, reference, runs)
            yield Known(bench, truth_of(entries[case], library), pairs)


def calibrate(bank: Path, key: Path, out: Path | None, benches: Sequence[str] = ()) -> Constants:
    """The constants of a bank, with the reliability before, after, and of benches left out."""
    before = shipped_constants()
    cases = list(known_cases(bank, key, benches))
    print(f"{len(cases)} check-ups, {sum(c.truth.kind == 'quiet' for c in cases)} of them quiet")
    now = examined(cases, before, _silent)
    limits = quiet_limits(now, before)
    for line in reliability_lines("before", reliability(now, before)):
        print(line, flush=True)
    by_form = []
    for form in FORMS:
        constants = msgspec.structs.replace(limits, further_form=form)
        by_form.append((constants, examined_again(cases, now, constants)))
    trials = tried(by_form)
    after = trials.best()
    held = list(left_out(trials, by_form))
    own = next(judged for c, judged in by_form if c.further_form == after.further_form)
    for title, found in (
        ("each bench by constants from the others", reliability_of(held)),
        ("after, on the benches they come from", reliability(own, after)),
    ):
        for line in reliability_lines(title, found):
            print(line)
    for name in before.__struct_fields__:
        print(f"  {name:<14} {getattr(before, name):>7g} -> {getattr(after, name):g}")
    if out is not None:
        out.write_text(_toml(after, bank.name, len(cases)))
        print(f"written: {out}")
    return after


def _toml(constants: Constants, bank: str, cases: int) -> str:
    head = (
        "# Constants of a check-up's decision; smad/gap/paired/constants.py says what each means.\n"
        "# Written by `python -m tests.withheld calibrate`"
        f" from {cases} check-ups of the bank {bank}.\n"
    )
    return toml_of(head, constants)


def toml_of(head: str, constants: msgspec.Struct) -> str:
    """Constants as a TOML below a comment."""
    values = ((n, getattr(constants, n)) for n in constants.__struct_fields__)
    return head + "".join(f"{name} = {float(value)}\n" for name, value in values)


def _silent(text: str) -> None:
    pass
