"""Judges a bank of check-ups with the product, and writes answers that `score` reads.

A bench is commissioned once, from its good repeats; each of its cases is then judged against that.
"""

import json
import random
import time
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from evaluation.errors import BankError
from evaluation.names import canonical
from evaluation.score.openings import refuse_sealed
from smad.checkup.commission import commissioned
from smad.checkup.files import read_file
from smad.checkup.judge import judged
from smad.checkup.paired.difference import Paired
from smad.checkup.paired.reference import Reference
from smad.diagnosis.runs import GapRun
from smad.diagnosis.search.names import likely_entries
from smad.diagnosis.spring_pair import SmaPlant
from smad.diagnosis.verdict import PLACES, QUIET, Verdict

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
    bank: Path,
    out: Path,
    *,
    benches: Sequence[str] = (),
    repeats: int | None = None,
    key: Path | None = None,
    jobs: int = 1,
) -> dict[str, Any]:
    """Verdicts of all cases (of some benches), written to `out` after each bench.

    With the key's folder single effects are judged once more without their entry. Raises BankError
    for a sealed key.
    """
    if key is not None:
        refuse_sealed(key)
    manifest = manifest_of(bank)
    verdicts: dict[str, Any] = {}
    document: dict[str, Any] = {
        "format": "smad-verdicts-2",
        "bank": manifest["bank"],
        "key_sha256": manifest["key_sha256"],
        "tool": {"version": "check-up", "commit": ""},
        "floors": {},
        "verdicts": verdicts,
    }
    wanted = list(benches) or sorted({c["bench"] for c in manifest["cases"]})
    with ProcessPoolExecutor(jobs) as pool:
        tasks = [pool.submit(_judged_bench, bank, b, repeats, key) for b in wanted]
        for task in as_completed(tasks):
            bench, floors, told = task.result()
            document["floors"][bench] = floors
            verdicts.update(told)
            out.write_text(json.dumps(document, indent=1))
    return document


def _judged_bench(
    bank: Path, bench: str, repeats: int | None, key: Path | None
) -> tuple[str, dict[str, float], dict[str, Any]]:
    """The floors of a bench, and the verdicts of its cases."""
    plant = SmaPlant()
    entries = single_entries(key, plant) if key is not None else {}
    manifest = manifest_of(bank)
    floors: dict[str, float] = {}
    verdicts: dict[str, Any] = {}
    of_bench = benches_of(bank, manifest, plant, only=[bench], repeats=repeats)
    for _, reference, cases in of_bench:
        for case, runs in cases:
            began = time.process_time()
            found = judged(plant, reference, runs)
            told = as_told(found.verdict, time.process_time() - began)
            floors = floors or _floors(found.pairs)
            told["baselines"] = baselines(found.pairs, case)
            if case in entries and found.verdict.outcome != QUIET:
                cause, names = entries[case]
                less = judged(plant, reference, runs, exclude=names)
                told["left_out"] = {cause: _short(less.verdict)}
            verdicts[case] = told
            print(f"{case} {bench} {found.verdict.headline}", flush=True)
    return bench, floors, verdicts


def _floors(pairs: Paired) -> dict[str, float]:
    """The repeat floor of each signal over the whole programme, RMS in its unit."""
    sd = np.concatenate([p.rows.sd for p in pairs.pairs])
    rms = np.sqrt(np.mean(sd**2, axis=0))
    return {c.name: float(f"{x:.4g}") for c, x in zip(pairs.plant.channels, rms, strict=True)}


def single_entries(key: Path, plant: SmaPlant) -> dict[str, tuple[str, list[str]]]:
    """Cases with one listed effect: its cause, and every entry of the library for that."""
    entries = json.loads((key / "KEY.json").read_text())["cases"]
    causes = {
        case: canonical(entry["effects"][0]["name"])
        for case, entry in entries.items()
        if entry["kind"] == "single"
    }
    return {
        case: (cause, [e.name for e in plant.effects if canonical(e.name) == cause])
        for case, cause in causes.items()
    }


def baselines(pairs: Paired, case: str) -> dict[str, Any]:
    """What simpler rules say: `match`, `bic` and `random`. None of them knows unknown.

    `match` is the signature most like the difference in floors, days, correlation and form left
    in. `bic` takes the entry with the best Bayesian information criterion, nothing among them.
    """
    floors = np.concatenate(
        [np.where(p.rows.valid, p.difference / p.rows.sd, 0.0).ravel() for p in pairs.pairs]
    )
    like: dict[str, float] = {}
    for i, atom in enumerate(pairs.reference.atoms):
        rows = np.concatenate(
            [
                np.where(p.rows.valid, p.reference.signatures[i] / p.rows.sd, 0.0).ravel()
                for p in pairs.pairs
            ]
        )
        size = float(rows @ rows)
        match = max(float(rows @ floors), 0.0) ** 2 / size if size > 0.0 else 0.0
        like[atom.entry] = max(like.get(atom.entry, 0.0), match)
    known = pairs.reference.atoms
    found = likely_entries(pairs, known, pairs.signatures, pairs.plant.effects, pairs.z)
    penalty = float(np.log(pairs.white.count))
    best = max(found, key=lambda e: e.gain - penalty * len(e.coordinates), default=None)
    speaks = best is not None and best.gain > penalty * len(best.coordinates)
    return {
        "match": {"outcome": PLACES, "names": [max(like, key=lambda n: like[n])]},
        "bic": {"outcome": PLACES if speaks else QUIET, "names": list(best.names) if best else []},
        "random": {"outcome": PLACES, "names": [random.Random(case).choice(sorted(like))]},
    }


def _short(found: Verdict) -> dict[str, Any]:
    return {"outcome": found.outcome, "places": [p.place for p in found.places]}


def as_told(found: Verdict, seconds: float) -> dict[str, Any]:
    """A verdict in the form that is scored."""
    return {
        "question": "check-up",
        "outcome": found.outcome,
        "headline": found.headline,
        "places": msgspec.to_builtins(found.places),
        "whole": msgspec.to_builtins(found.whole),
        "seconds": round(seconds, 2),
    }
