"""Facts of the paper that cannot hold together; rows of "paper against here" refer to them."""

from collections.abc import Mapping

CONTRADICTIONS: Mapping[str, str] = {
    "water": "The printed thermal model with water at 300 K, and motion at ≤ 4 A: with it 1 A ends "
    "at 301 K and 4 A at 308 K, below the loaded springs' A_S + τ/C_A of 308.3 K (Fig. 10).",
    "resistivity": "A resistivity of 0.44 µΩ·m with all the tube water warming, and the 7 s "
    "tracking of Fig. 11: the heat does not suffice. Set B therefore lets a quarter of the water "
    "warm.",
    "stroke": "An amplitude of 12 mm in Fig. 12 and a full stroke of ±10 mm in Fig. 9. A sinusoid "
    "cut at 10 mm still scores R² = 0.989.",
    "moduli": "G_A/G_M = 2.55 of Brinson's table, and ξ_X = 0.27 at 10 mm in Fig. 9, which needs "
    "1.99.",
    "step 4": "Eq. (13a) below M_S, and step 4 of the cycle: the condition T > M_S is missing in "
    "print.",
    "Biot": "Bi ≤ 0.1 as stated, and Eq. (14) with the paper's own numbers, which gives 0.34 to "
    "0.39; the stated values need the length d_s/4.",
    "energy": "Conservation of energy, and C_s 466/260 J/kgK with L 12 188/4 138 J/kg for heating "
    "and cooling: switching between them makes or destroys heat. The plant books that apart.",
}
"""By the key that `Comparison.contradiction` names."""


def numbered() -> list[str]:
    """The contradictions as lines, numbered from 1."""
    return [f"{k}. {text}" for k, text in enumerate(CONTRADICTIONS.values(), 1)]


def reference(key: str) -> str:
    """Where a row points to; raises KeyError for a key that is not in the table."""
    if key not in CONTRADICTIONS:
        raise KeyError(key)
    return f"see contradiction {list(CONTRADICTIONS).index(key) + 1}"
