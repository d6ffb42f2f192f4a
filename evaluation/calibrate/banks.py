"""Development cases of both kinds: of the product's own simulator, and of the independent plant."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import msgspec

from evaluation.calibrate.rivals import LISTED, MOVED, NONE, UNLISTED, CaseRivals
from evaluation.errors import BankError
from evaluation.names import canonical
from evaluation.recovery.judging import Answer
from evaluation.recovery.running import RecoveryFile
from evaluation.run.running import VerdictFile
from evaluation.score.answers import CaseKey, digest, read_key
from evaluation.score.first_step import ScoredVerdict
from evaluation.score.openings import refuse_sealed
from smad.diagnosis.places.bare import with_places
from smad.diagnosis.spring_pair import SmaPlant
from smad.diagnosis.verdict import DIFFERS

_TRUTHS = {
    "none": NONE, "room": NONE, "preload": NONE, "drift": NONE, "parameters": MOVED,
    "single": LISTED, "pair": LISTED, "triple": LISTED, "unknown": UNLISTED,
}  # fmt: skip


class _Form(msgspec.Struct):
    # A verdict file leaves out what is its default.
    format: str = ""


def cases_of(path: Path, keys: Sequence[Path]) -> list[CaseRivals]:
    """The cases of a file of `recover` or `check`; of the second the key is one of `keys`.

    Raises BankError for another file, for a missing key and for a sealed one.
    """
    try:
        data = path.read_bytes()
        form = msgspec.json.decode(data, type=_Form).format
        if form == "smad-recovery-1":
            answers = msgspec.json.decode(data, type=RecoveryFile).answers
            return _of_recovery(list(answers.values()))
        return _of_bank(path, msgspec.json.decode(data, type=VerdictFile), keys)
    except (OSError, msgspec.MsgspecError) as error:
        raise BankError(f"{path} is not by `recover` or `check` ({error}): give one") from None


def _of_recovery(answers: Sequence[Answer]) -> list[CaseRivals]:
    plant = SmaPlant()
    places = {e.name: e.places for e in plant.effects}
    out = []
    for answer in answers:
        case, verdict = answer.case, answer.verdict
        if verdict is None or not verdict.first_step:
            continue
        out.append(
            CaseRivals(
                case=case.name,
                # An effect at another strength, or in another question, is no other case.
                fold=f"own simulator {min(case.effects, default=case.name)}",
                question=case.question,
                exact=True,
                truth=_TRUTHS[case.kind],
                names=frozenset(canonical(n) for n in case.effects),
                places=frozenset(p for n in case.effects for p in places[n]),
                rivals=tuple(verdict.first_step),
                independent_rows=verdict.independent_rows,
                **_counts(plant),
            )
        )
    return out


def _of_bank(path: Path, file: VerdictFile, keys: Sequence[Path]) -> list[CaseRivals]:
    """Without those of *differs*, where the plant's own differences have no order."""
    key = next((k for k in keys if digest(k) == file.key_sha256), None)
    if key is None:
        raise BankError(f"no key of {path} is given: add --key KEY.json of its bank")
    refuse_sealed(key)
    truths = read_key(key).cases
    plant = SmaPlant()
    out = []
    for name, raw in file.verdicts.items():
        truth, verdict = truths[name], msgspec.convert(raw, ScoredVerdict)
        if truth.question == DIFFERS or not verdict.first_step:
            continue
        out.append(
            CaseRivals(
                case=name,
                fold=f"{file.bank} {_bench(truth, name)}",
                question=truth.question,
                exact=False,
                truth=_TRUTHS[truth.kind],
                names=frozenset(e.name for e in truth.effects),
                places=frozenset(p for e in truth.effects for p in e.places),
                rivals=tuple(verdict.first_step),
                independent_rows=verdict.independent_rows,
                **_counts(plant),
            )
        )
    return out


def _bench(truth: CaseKey, name: str) -> str:
    return f"bench {truth.bench}" if truth.bench else name


def _counts(plant: SmaPlant) -> dict[str, int]:
    """How many effects and laws share the prior of their kind."""
    return {"effects": len(plant.effects), "laws": len(with_places(plant).places)}
