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
    """Every effect, large and small, in the library and out of it; none; parameters; two."""
    for since in (False, True):
        good = bank(OTHER, seed=40)[:3] if since else []
        word = "changed" if since else "differs"
        asked: dict[str, tuple[Any, HeaterPlant]] = {
            "none": (bank(OTHER, seed=7), HeaterPlant()),
            "parameters": (bank(FAR_OFF), HeaterPlant()),
            "two": (bank(OTHER, TWO), HeaterPlant()),
        }
        for name, values in SHOWN.items():
            small = {name: {k: SMALL * v for k, v in values.items()}}
            asked[name] = bank(OTHER, {name: values}), HeaterPlant()
            asked[f"{name}, small"] = bank(OTHER, small), HeaterPlant()
            asked[f"{name}, not in the library"] = bank(OTHER, {name: values}), without(name)
        for what, (runs, plant) in asked.items():
            yield f"{word}: {what}", {"runs": runs, "plant": plant, "good": good}


def main() -> None:
    """Prints the answers as they are, then what each dropped threshold changes."""
    found = {}
    for name, question in questions():
        found[name] = {k: str(v) for k, v in answers(ready(**question)).items()}
        print(f"{name}  →  {found[name]['']}", flush=True)
    print(table(found))


if __name__ == "__main__":
    main()
