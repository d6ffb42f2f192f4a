"""Constants of the check-up from a development bank, and how reliable they are before and after."""

import json
import pickle
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from pathlib import Path
from typing import Any

from evaluation.run.check_ups import benches_of, manifest_of
from evaluation.score.openings import refuse_sealed
from smad.checkup.calibrate import (
    Judged,
    Truth,
    apart,
    bare,
    left_out,
    quiet_limits,
    reliability,
    reliability_lines,
    reliability_of,
    tried,
)
from smad.checkup.constants import Constants, shipped_constants
from smad.checkup.judge import examine
from smad.checkup.paired.difference import paired
from smad.diagnosis.bank.names import canonical
from smad.diagnosis.spring_pair import SmaPlant

_KINDS = {
    "none": "quiet",
    "room": "quiet",
    "preload": "quiet",
    "drift": "quiet",
    "parameters": "parameters",
    "unknown": "unknown",
}


def truth_of(entry: dict[str, Any]) -> Truth:
    """The truth of a key's entry; an effect that the library lacks is unknown."""
    kind = _KINDS.get(entry["kind"], "effects")
    if kind != "effects":
        return Truth(kind)
    return Truth(kind, frozenset(canonical(e["name"]) for e in entry["effects"]))


def kept_findings(
    bank: Path, key: Path, kept: Path, only: Sequence[str] = (), jobs: int = 1
) -> list[Judged]:
    """What the check-ups of a bank found; each bench is kept once it is examined."""
    manifest = manifest_of(bank)
    refuse_sealed(key)
    kept.mkdir(parents=True, exist_ok=True)
    wanted = only or sorted({c["bench"] for c in manifest["cases"]})
    places = {bench: kept / f"{bank.name}-{bench}.pickle" for bench in wanted}
    missing = [bench for bench in wanted if not places[bench].exists()]
    with ProcessPoolExecutor(jobs) as pool:
        tasks = [pool.submit(_examine_bench, bank, key, b, places[b]) for b in missing]
        for done in as_completed(tasks):
            print(done.result(), flush=True)
    return [case for b in wanted for case in pickle.loads(places[b].read_bytes())]


def _examine_bench(bank: Path, key: Path, bench: str, place: Path) -> str:
    """Keeps what the check-ups of one bench found at `place`."""
    plant, constants = SmaPlant(), shipped_constants()
    entries = json.loads((key / "KEY.json").read_text())["cases"]
    ((_, reference, cases),) = benches_of(bank, manifest_of(bank), plant, only=[bench])
    found = [
        Judged(
            f"{bank.name} {bench}",
            truth_of(entries[case]),
            bare(examine(paired(plant, reference, runs), constants)),
        )
        for case, runs in cases
    ]
    place.write_bytes(pickle.dumps(found))
    return f"{bank.name} {bench}: {len(found)} check-ups"


def calibrate(
    banks: Sequence[Path],
    kept: Path,
    out: Path | None,
    benches: Sequence[str] = (),
    *,
    jobs: int = 1,
) -> Constants:
    """The constants of banks, with the reliability before, after, and of benches left out.

    The key of a bank is in the folder of its name with `-key` beside it.
    """
    before = shipped_constants()
    cases = [
        found
        for bank in banks
        for found in kept_findings(bank, bank.with_name(f"{bank.name}-key"), kept, benches, jobs)
    ]
    print(f"{len(cases)} check-ups, {sum(j.truth.kind == 'quiet' for j in cases)} of them quiet")
    print(
        "a right best entry leaves less than a wrong one in "
        f"{apart(cases, before):.2f} of the couples"
    )
    limits = quiet_limits(cases, before)
    for line in reliability_lines("before", reliability(cases, before)):
        print(line, flush=True)
    trials = tried(cases, limits)
    after = trials.best()
    held = list(left_out(trials, cases))
    for title, found in (
        ("each bench by constants from the others", reliability_of(held)),
        ("after, on the benches they come from", reliability(cases, after)),
    ):
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
        "# Constants of a check-up's decision; smad/checkup/constants.py says what each means.\n"
        "# Written by `python -m evaluation calibrate`"
        f" from {cases} check-ups of {banks}.\n"
    )
    values = ((n, getattr(constants, n)) for n in constants.__struct_fields__)
    return head + "".join(f"{name} = {float(value)}\n" for name, value in values)
