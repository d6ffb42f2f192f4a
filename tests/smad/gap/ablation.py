"""What each threshold of the verdict changes on questions about the tiny plant.

    python -m tests.smad.gap.ablation

As `python -m tests.withheld ablate` does on a bank of the withheld plant, in minutes.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from smad.gap.diagnose import ready
from tests.smad.gap.cases import FAR_OFF, OTHER, SHOWN, bank, without
from tests.smad.gap.heater_plant import HeaterPlant
from tests.withheld.ablation import answers, table

TWO = {"sensor_lag": {"tau_s": 1.2}, "coupling": {"g_W_K": 0.12}}
SMALL = 0.4


def questions() -> Iterator[tuple[str, Mapping[str, Any]]]:
    """None; parameters; two effects; every effect small, and large and not in the library."""
    for since in (True, False):
        good = bank(OTHER, seed=40)[:3] if since else []
        word = "changed" if since else "differs"
        asked: dict[str, tuple[Any, HeaterPlant]] = {
            "none": (bank(OTHER, seed=7), HeaterPlant()),
            "parameters": (bank(FAR_OFF), HeaterPlant()),
            "two": (bank(OTHER, TWO), HeaterPlant()),
        }
        for name, values in SHOWN.items():
            small = {name: {k: SMALL * v for k, v in values.items()}}
            asked[f"{name}, not in the library"] = bank(OTHER, {name: values}), without(name)
            asked[f"{name}, small"] = bank(OTHER, small), HeaterPlant()
        for what, (runs, plant) in asked.items():
            yield f"{word}: {what}", {"runs": runs, "plant": plant, "good": good}


def main() -> None:
    """Prints the answers as they are, then what each dropped threshold changes."""
    found = {}
    for name, question in questions():
        said = found[name] = {k: str(v) for k, v in answers(ready(**question)).items()}
        changed = [f"{k}: {v}" for k, v in said.items() if v != said[""]]
        print(f"{name}  →  {said['']}", *changed, sep="\n    ", flush=True)
    print(table(found))


if __name__ == "__main__":
    main()
