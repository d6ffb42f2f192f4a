"""One atheris run in a process of its own: `python -m campaign fuzz.child TARGET FOLDER [FLAG…]`.

libFuzzer ends its process when it is done, so nothing can be returned: what was found is written
into FOLDER/findings, an input and a text each, and libFuzzer's own words go to standard error.
A finding does not end the run; the same one is kept once.
"""

from __future__ import annotations

import hashlib
import random
import sys
import traceback
from collections.abc import Callable
from pathlib import Path

import atheris

from campaign.fuzz.limits import FINDINGS, kind_of, within_limits
from campaign.fuzz.mutate import Mutator
from campaign.fuzz.targets import TARGETS, Harness, Target

_KERNEL = "sim_device.plant.kernel"
_COMPILED = [
    _KERNEL,
    *(
        f"{_KERNEL}.{module.stem}"
        for module in (Path(__file__).parents[2] / "sim_device/plant/kernel").glob("*.py")
    ),
]
"""numba compiles these from their bytecode, which has to stay as it is."""


def main(arguments: list[str]) -> None:
    """Fuzz one target with libFuzzer's flags."""
    target, folder = TARGETS[arguments[0]], Path(arguments[1])
    with atheris.instrument_imports(include=list(target.instrumented), exclude=_COMPILED):
        harness = target.harness()
    # The next counter that would be given out is how many there are.
    sys.stderr.write(f"counters: {atheris._reserve_counter()}\n")
    rng = random.Random(0)
    mutator = Mutator(target, list(target.corpus().values()), rng)
    again = f"{sys.executable} -m campaign.fuzz.child {target.name} {folder}"
    atheris.Setup(
        [again, *arguments[2:]],
        _collecting(target, harness, folder / FINDINGS),
        custom_mutator=_mixed(mutator, rng),
    )
    atheris.Fuzz()


def _mixed(mutator: Mutator, rng: random.Random) -> Callable[[bytes, int, int], bytes]:
    """Half of the mutations are libFuzzer's, half those that know lines and words."""

    def mutate(data: bytes, most: int, seed: int) -> bytes:
        rng.seed(seed)
        if seed & 1:
            mutated: bytes = atheris.Mutate(data, most)
            return mutated
        return mutator.change(data)[:most]

    return mutate


def _collecting(target: Target, harness: Harness, findings: Path) -> Harness:
    findings.mkdir(parents=True, exist_ok=True)
    limited = within_limits(harness, target.allowed_s)
    seen: set[str] = set()

    def try_input(data: bytes) -> None:
        try:
            limited(data)
        except Exception as error:
            kind = kind_of(error)
            if kind not in seen:
                seen.add(kind)
                name = hashlib.sha256(data).hexdigest()[:12]
                (findings / f"{name}.input").write_bytes(data)
                text = "".join(traceback.format_exception(error))
                (findings / f"{name}.txt").write_text(f"{kind}\n{text}")

    return try_input


if __name__ == "__main__":
    main(sys.argv[1:])
