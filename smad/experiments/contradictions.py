"""Contradictions in the paper; rows of the comparison with it refer to them."""

from collections.abc import Mapping

CONTRADICTIONS: Mapping[str, str] = {
    "water": "The printed thermal model, with water at 300 K, cannot move the pair at ≤ 4 A: 1 A "
    "ends at 301 K and 4 A at 308 K, below the loaded springs' A_S + τ/C_A of 308.3 K (Fig. 10).",
    "resistivity": "With a resistivity of 0.44 µΩ·m, and all the tube water warming, the heat does "
    "not suffice for the 7 s tracking of Fig. 11. In set B a quarter of the water warms.",
    "stroke": "Fig. 12 has an amplitude of 12 mm, Fig. 9 a full stroke of ±10 mm. A sinusoid cut "
    "at 10 mm still scores R² = 0.989.",
    "moduli": "Brinson's table has G_A/G_M = 2.55; ξ_X = 0.27 at 10 mm in Fig. 9 needs 1.99.",
    "step 4": "Below M_S, Eq. (13a) contradicts step 4 of the cycle: the print lacks the condition "
    "T > M_S.",
    "Biot": "The paper states Bi ≤ 0.1, but its Eq. (14) with its own numbers gives 0.34 to 0.39; "
    "the stated values need the length d_s/4.",
    "energy": "C_s of 466/260 J/kgK and L of 12 188/4 138 J/kg for heating and cooling violate "
    "conservation of energy: each change of direction makes or destroys heat. The plant's energy "
    "balance lists that heat separately.",
}
"""By the key that `Comparison.contradiction` names."""


def reference(key: str) -> str:
    """Where a row points to; raises KeyError for a key that is not in the table."""
    numbers = {name: k for k, name in enumerate(CONTRADICTIONS, 1)}
    return f"see contradiction {numbers[key]}"
