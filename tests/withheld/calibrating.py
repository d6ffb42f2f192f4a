"""Constants of the check-up from a development bank, and how reliable they are before and after."""

import json
import pickle
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import msgspec

from smad.gap.check.names import canonical
from smad.gap.paired.calibrate import (
    FORMS,
    Judged,
    Known,
    Truth,
    apart,
    examined,
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
from smad.gap.paired.verdict import is_quiet
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


def kept_findings(
    bank: Path, key: Path, kept: Path, only: Sequence[str] = ()
) -> list[dict[float, Judged]]:
    """What the check-ups of a bank found, by `FORMS`; each bench is kept once it is examined."""
    manifest = manifest_of(bank)
    entries = json.loads((key / "KEY.json").read_text())["cases"]
    if "sealed" in str(manifest["bank"]):
        raise BankError(f"{bank} is sealed: constants come from development banks")
    plant = SmaPlant()
    library = {canonical(e.name): e.name for e in plant.effects}
    kept.mkdir(parents=True, exist_ok=True)

    def place(bench: str) -> Path:
        return kept / f"{bank.name}-{bench}.pickle"

    wanted = only or sorted({c["bench"] for c in manifest["cases"]})
    missing = [b for b in wanted if not place(b).exists()]
    if missing:
        for bench, reference, cases in benches_of(bank, manifest, plant, only=missing):
            found = []
            for case, runs in cases:
                pairs = paired(plant, TRAITS, reference, runs)
                known = Known(f"{bank.name} {bench}", truth_of(entries[case], library), pairs)
                found.append(examined(known, shipped_constants()))
            place(bench).write_bytes(pickle.dumps(found))
            print(f"{bank.name} {bench}: {len(found)} check-ups", flush=True)
    return [case for b in wanted for case in pickle.loads(place(b).read_bytes())]


def calibrate(
    banks: Sequence[Path],
    kept: Path,
    out: Path | None,
    benches: Sequence[str] = (),
    *,
    with_limits: bool = False,
) -> Constants:
    """The constants of banks, with the reliability before, after, and of benches left out.

    The key of a bank is in the folder of its name with `-key` beside it. The limits of a quiet
    bench stay as they are unless asked for `with_limits`, which want many quiet benches.
    """
    before = shipped_constants()
    cases = [
        found
        for bank in banks
        for found in kept_findings(bank, bank.with_name(f"{bank.name}-key"), kept, benches)
    ]
    by_own_form = {form: [case[form] for case in cases] for form in FORMS}
    now = by_own_form[before.further_form]
    print(f"{len(now)} check-ups, {sum(j.truth.kind == 'quiet' for j in now)} of them quiet")
    changed = [j for j in now if not is_quiet(j.findings, before)]
    print(
        f"a right first entry leaves less than a wrong one in {apart(changed):.2f} of the couples"
    )
    limits = quiet_limits(now, before) if with_limits else before
    for line in reliability_lines("before", reliability(now, before)):
        print(line, flush=True)
    by_form = [
        (msgspec.structs.replace(limits, further_form=form), judged)
        for form, judged in by_own_form.items()
    ]
    trials = tried(by_form)
    after = trials.best()
    held = list(left_out(trials, by_form))
    for title, found in (
        ("each bench by constants from the others", reliability_of(held)),
        ("after, on the benches they come from", reliability(by_own_form[after.further_form],
                                                             after)),
    ):  # fmt: skip
        for line in reliability_lines(title, found):
            print(line)
    for name in before.__struct_fields__:
        print(f"  {name:<14} {getattr(before, name):>7g} -> {getattr(after, name):g}")
    if out is not None:
        names = ", ".join(bank.name for bank in banks)
        out.write_text(_toml(after, names, len(cases)))
        print(f"written: {out}")
    return after


def _toml(constants: Constants, banks: str, cases: int) -> str:
    head = (
        "# Constants of a check-up's decision; smad/gap/paired/constants.py says what each means.\n"
        "# Written by `python -m tests.withheld calibrate`"
        f" from {cases} check-ups of {banks}.\n"
    )
    return toml_of(head, constants)


def toml_of(head: str, constants: msgspec.Struct) -> str:
    """Constants as a TOML below a comment."""
    values = ((n, getattr(constants, n)) for n in constants.__struct_fields__)
    return head + "".join(f"{name} = {float(value)}\n" for name, value in values)
