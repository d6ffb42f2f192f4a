"""Judges a bank of check-ups with the product, and writes verdicts that `smad gap score` reads.

A bench is commissioned once, from its good repeats; each of its cases is then judged against that.
"""

import json
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from smad.gap.paired.commission import checked, commissioned
from smad.gap.paired.files import read_file
from smad.gap.paired.reference import Reference
from smad.gap.paired.verdict import Verdict
from smad.gap.runs import GapRun
from smad.gap.sma import SmaPlant
from tests.withheld.errors import BankError

OUTCOMES = {
    "quiet": "no_gap",
    "parameters": "parameters_only",
    "cause": "effect",
    "group": "ambiguous",
    "unknown": "unknown",
}


Recordings = list[tuple[GapRun, str]]
"""The runs of a case, each with its name."""


def manifest_of(bank: Path) -> dict[str, Any]:
    """What a bank says of itself. Raises BankError when it is none of check-ups."""
    try:
        manifest: dict[str, Any] = json.loads((bank / "manifest.json").read_text())
    except OSError as error:
        raise BankError(f"{bank} is no bank: {error.strerror}; make one with `play`") from None
    if manifest["format"] != "smad-checkup-1":
        raise BankError(f"{bank} is a bank of {manifest['format']}; give one of smad-checkup-1")
    return manifest


def benches_of(
    bank: Path,
    manifest: dict[str, Any],
    plant: SmaPlant,
    *,
    only: Sequence[str] = (),
    repeats: int | None = None,
) -> Iterator[tuple[str, Reference, Iterator[tuple[str, Recordings]]]]:
    """Each bench with its reference, commissioned from its good repeats, and its cases."""
    for bench in sorted({c["bench"] for c in manifest["cases"]}):
        if only and bench not in only:
            continue
        folders = sorted((bank / "benches" / bench).iterdir())[:repeats]
        repeated = [[read_file(p) for p in sorted(f.iterdir())] for f in folders]
        reference = commissioned(plant, list(zip(*repeated, strict=True)))
        ids = [c["id"] for c in manifest["cases"] if c["bench"] == bench]
        yield bench, reference, ((case, _runs_of(bank, case)) for case in ids)


def _runs_of(bank: Path, case: str) -> Recordings:
    runs = [read_file(p) for p in sorted((bank / "cases" / case).iterdir())]
    return [(r, r.name) for r in runs]


def run(
    bank: Path, out: Path, *, benches: Sequence[str] = (), repeats: int | None = None
) -> dict[str, Any]:
    """Verdicts of all cases (of some benches), written to `out` after each bench."""
    manifest = manifest_of(bank)
    plant = SmaPlant()
    verdicts: dict[str, Any] = {}
    document = {
        "format": "smad-verdicts-1",
        "bank": manifest["bank"],
        "key_sha256": manifest["key_sha256"],
        "tool": {"version": "check-up", "commit": ""},
        "verdicts": verdicts,
    }
    for bench, reference, cases in benches_of(bank, manifest, plant, only=benches, repeats=repeats):
        for case, runs in cases:
            began = time.process_time()
            found = checked(plant, reference, runs)
            verdicts[case] = _verdict(found, time.process_time() - began)
            print(f"{case} {bench} {found.ratio:.2f} {found.left:.2f} {found.headline}", flush=True)
        out.write_text(json.dumps(document, indent=1))
    return document


def _verdict(found: Verdict, seconds: float) -> dict[str, Any]:
    return {
        "outcome": OUTCOMES[found.outcome],
        "causes": [
            {"names": x.names, "probability": round(x.probability, 6)} for x in found.likely
        ],
        "group": found.group,
        "held_out": {},
        "shrink": round(1.0 - found.left, 4) if found.outcome != "quiet" else 0.0,
        "seconds": round(seconds, 2),
    }
