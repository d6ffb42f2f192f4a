"""Numbers that other laboratories measured, beside what the plant gives for their geometry.

Of a source are taken: geometry, currents, room temperature, the transformation temperatures of its
alloy (`published_runs.py`). `python -m sim_device.plant.docs` writes the table.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

from sim_device.plant.parameters import load_parameters
from sim_device.plant.published_runs import (
    LATENT_HEAT_OF_D,
    SPECIFIC_HEAT_OF_D,
    force_of_l,
    heated_in_air,
    relaxing_of_l,
    resistance_per_m,
    stated_per_m,
    timed,
    wire,
)

SOURCES = {
    "K": "Kolyvas et al. 2018, doi 10.1177/1045389X18770880: three files of "
    "efthymiosKolyvas/modelBasedDesignSMAs (0.51 mm wire, 3.45 mm coil, 8 turns)",
    "D": "Dynalloy, Technical characteristics of Flexinol, F1140 (all values approximate); "
    "transformation temperatures from NicholasBaraghini/"
    "Modeling-and-Simulation-of-Mechatronic-Systems",
    "M": "its Rev. M of 2025, and an older edition, as cited in public repositories",
    "T": "Tadesse et al. 2010, doi 10.1177/1045389X09352814, abstract",
    "N": "Nizamani et al. 2017, doi 10.5772/intechopen.69868, abstract (0.15 mm wire)",
    "C": "copper-cored spring 2021, doi 10.1177/16878140211044651, abstract",
    "L": "Delta Robotics, `docs-released/hardware` of Delta-Robotics-Inc/Delta-Public; its "
    "estimates, still to be validated (wire in water: 100 times air)",
    "H": "Shaw, Churchill, Iadicola 2008, Experimental Techniques, part 1, abstract: DSC of two "
    "wires",
}
NEAR = 0.2
"""So close counts as near, where a source states no interval."""
DIGITS = 0.01
"""So close to a bound counts as inside: sources state theirs to two digits."""


@dataclass(frozen=True, kw_only=True)
class Published:
    """One published number. `ours` is None where the plant has no such law or lacks the geometry.

    stated: the interval that the source gives for it, or between its files or editions. fitted: the
    coil's film, or the speed of a fan, was made from it. with_heats: `ours` with the specific and
    latent heat of D.
    """

    what: str
    source: str
    value: float
    unit: str
    ours: Callable[[], float] | None = None
    missing: str = ""
    fitted: bool = False
    stated: tuple[float, float] | None = None
    with_heats: Callable[[], float] | None = None

    @property
    def ratio(self) -> float | None:
        """What the plant gives over what was published."""
        return None if self.ours is None else self.ours() / self.value

    @property
    def near(self) -> bool:
        """Whether ours is in the interval that is stated, or within NEAR where none is."""
        if self.ours is None:
            return False
        low, high = self.stated or ((1.0 - NEAR) * self.value, (1.0 + NEAR) * self.value)
        return low * (1.0 - DIGITS) <= self.ours() <= high * (1.0 + DIGITS)


def _phases_over_one_another() -> float:
    """Resistance of the hot spring over that of the cold one: the plant has one resistivity."""
    return 1.0


def _parameter(name: str) -> Callable[[], float]:
    return lambda: load_parameters("conserving")[name]


def _shear_slope() -> float:
    """Mean stress slope of the transformation lines, in shear, MPa/K."""
    base = load_parameters("conserving")
    return 0.5e-6 * (base["slope_austenite"] + base["slope_martensite"])


_HEAT = "the alloy's heat"
_WATER = "water not described"
_THIN = "the air film of thin wires"
_PHASE = "`phase_resistivity` is off"
NUMBERS: tuple[Published, ...] = (
    Published(what="resistance of the spring", source="K", value=0.35, unit="Ω",
              stated=(0.35, 0.55),
              ours=lambda: resistance_per_m(0.51) * math.pi * 3.45e-3 * 8),
    Published(what="rise at 1 A, turns touching", source="K", value=85.3, unit="K",
              ours=lambda: heated_in_air(1.0, 0.0)[0], fitted=True),
    Published(what="rise at 1 A, pitch 3 mm", source="K", value=38.9, unit="K",
              ours=lambda: heated_in_air(1.0, 3.0)[0], fitted=True),
    Published(what="rise at 0.71 A, pitch 1.5 mm", source="K", value=32.7, unit="K",
              stated=(32.7, 42.3), fitted=True,
              ours=lambda: heated_in_air(0.5**0.5, 1.5)[0]),
    Published(what="time constant, turns touching", source="K", value=28.1, unit="s",
              ours=lambda: heated_in_air(1.0, 0.0)[1], missing=_HEAT,
              with_heats=lambda: heated_in_air(1.0, 0.0, True)[1]),
    Published(what="time constant, pitch 3 mm", source="K", value=12.8, unit="s",
              ours=lambda: heated_in_air(1.0, 3.0)[1], missing=_HEAT,
              with_heats=lambda: heated_in_air(1.0, 3.0, True)[1]),
    Published(what="stress slope, in shear (10.6 MPa/K / √3)", source="K", value=6.12,
              unit="MPa/K", ours=_shear_slope),
    Published(what="resistance, 0.076 mm wire", source="D", value=196.9, unit="Ω/m",
              ours=lambda: resistance_per_m(0.0762), stated=stated_per_m(0.0762)),
    Published(what="resistance, 0.15 mm wire", source="D", value=51.2, unit="Ω/m",
              ours=lambda: resistance_per_m(0.1524), stated=stated_per_m(0.1524)),
    Published(what="resistance, 0.25 mm wire", source="D", value=18.5, unit="Ω/m",
              ours=lambda: resistance_per_m(0.254), stated=stated_per_m(0.254)),
    Published(what="resistance, 0.51 mm wire", source="D", value=4.3, unit="Ω/m",
              ours=lambda: resistance_per_m(0.508), stated=stated_per_m(0.508)),
    Published(what="0.15 mm, 70 °C: contracts at 0.4 A", source="D", value=1.0, unit="s",
              **timed(wire(0.1524), 0.4, "70 °C", "contract"),
              missing="one current stated for both"),
    Published(what="0.15 mm, 90 °C: contracts at 0.4 A", source="D", value=1.0, unit="s",
              **timed(wire(0.1524), 0.4, "90 °C", "contract")),
    Published(what="0.15 mm, 70 °C: relaxes", source="D", value=2.0, unit="s",
              **timed(wire(0.1524), 0.4, "70 °C", "relax")),
    Published(what="0.15 mm, 90 °C: relaxes", source="D", value=1.2, unit="s",
              **timed(wire(0.1524), 0.4, "90 °C", "relax")),
    Published(what="0.076 mm, 70 °C: contracts at 0.1 A", source="D", value=1.0, unit="s",
              **timed(wire(0.0762), 0.1, "70 °C", "contract"),
              missing=_THIN),
    Published(what="specific heat", source="D", value=SPECIFIC_HEAT_OF_D, unit="J/(kg K)",
              ours=_parameter("heat_capacity_heating"), missing=_HEAT),
    Published(what="latent heat", source="D", value=LATENT_HEAT_OF_D, unit="J/kg",
              ours=_parameter("latent_heating"), missing=_HEAT),
    Published(what="relaxing cooled over still air (0.30 s / 1.6 s)", source="T",
              value=0.19, unit="", stated=(0.19, 0.28), missing="the speed of its flow"),
    Published(what="cooling in a grease-filled tube over air", source="N", value=0.7, unit="",
              missing="grease or oil"),
    Published(what="cooling in an oil-filled tube over air", source="N", value=0.8, unit="",
              missing="grease or oil"),
    Published(what="response at 3 A", source="C", value=26.0, unit="s",
              missing="the copper core; its dimensions"),
    Published(what="force, 0.5 mm spring", source="L", value=2.5, unit="N",
              stated=(2.0, 3.0), ours=force_of_l(0.5)),
    Published(what="force, 1 mm spring", source="L", value=9.0, unit="N",
              stated=(8.0, 10.0), ours=force_of_l(1.0)),
    Published(what="force, 2 mm spring", source="L", value=27.5, unit="N",
              stated=(25.0, 30.0), ours=force_of_l(2.0)),
    Published(what="0.5 mm spring relaxes in air", source="L", value=10.0, unit="s",
              stated=(5.0, 15.0), **relaxing_of_l(0.5, "air")),
    Published(what="1 mm spring relaxes in air", source="L", value=25.0, unit="s",
              stated=(20.0, 30.0), **relaxing_of_l(1.0, "air")),
    Published(what="2 mm spring relaxes in air", source="L", value=60.0, unit="s",
              **relaxing_of_l(2.0, "air"),
              missing="its wire in air: 100 s"),
    Published(what="0.5 mm spring relaxes in water", source="L", value=1.0, unit="s",
              **relaxing_of_l(0.5, "bath"),
              missing=_WATER),
    Published(what="1 mm spring relaxes in water", source="L", value=2.5, unit="s",
              stated=(2.0, 3.0), **relaxing_of_l(1.0, "bath"),
              missing=_WATER),
    Published(what="2 mm spring relaxes in water", source="L", value=6.0, unit="s",
              stated=(5.0, 7.0), **relaxing_of_l(2.0, "bath"),
              missing=_WATER),
    Published(what="0.5 mm spring relaxes behind a fan", source="L", value=4.0, unit="s",
              stated=(2.0, 6.0), **relaxing_of_l(0.5, "fan")),
    Published(what="1 mm spring relaxes behind a fan", source="L", value=11.5, unit="s",
              stated=(8.0, 15.0), **relaxing_of_l(1.0, "fan"), fitted=True),
    Published(what="2 mm spring relaxes behind a fan", source="L", value=25.0, unit="s",
              stated=(20.0, 30.0), **relaxing_of_l(2.0, "fan"),
              missing="its wire in air: 100 s"),
    Published(what="stroke, 1 mm spring", source="L", value=35.0, unit="mm",
              stated=(30.0, 40.0), missing="its load is not stated"),
    Published(what="2 mm wire at 15 A contracts", source="L", value=35.3, unit="s",
              **timed(wire(2.0), 15.0, "90 °C", "contract"),
              missing=_HEAT),
    Published(what="resistance, austenite over martensite", source="L", value=0.94, unit="",
              ours=_phases_over_one_another,
              missing=_PHASE),
    Published(what="resistance, austenite over martensite", source="D", value=1.25, unit="",
              ours=_phases_over_one_another,
              missing=_PHASE),
    Published(what="resistance, 0.025 mm wire", source="M", value=1425.0, unit="Ω/m",
              ours=lambda: resistance_per_m(0.0254)),
    Published(what="resistance, 0.2 mm wire", source="M", value=29.0, unit="Ω/m",
              stated=stated_per_m(0.2032), ours=lambda: resistance_per_m(0.2032)),
    Published(what="0.025 mm, 70 °C: contracts at 45 mA", source="M", value=1.0, unit="s",
              **timed(wire(0.0254), 0.045, "70 °C", "contract"),
              missing=_THIN),
    Published(what="0.025 mm, 70 °C: relaxes", source="M", value=0.18, unit="s",
              **timed(wire(0.0254), 0.1, "70 °C", "relax"),
              missing=_HEAT),
    Published(what="0.025 mm, 90 °C: relaxes", source="M", value=0.15, unit="s",
              **timed(wire(0.0254), 0.1, "90 °C", "relax"),
              missing=_HEAT),
    Published(what="0.076 mm, 70 °C: relaxes", source="M", value=0.8, unit="s",
              stated=(0.5, 0.8), **timed(wire(0.0762), 0.2, "70 °C", "relax")),
    Published(what="0.1 mm, 70 °C: relaxes", source="M", value=1.1, unit="s",
              **timed(wire(0.1016), 0.3, "70 °C", "relax")),
    Published(what="0.1 mm, 90 °C: relaxes", source="M", value=0.9, unit="s",
              **timed(wire(0.1016), 0.3, "90 °C", "relax"),
              missing=_HEAT),
    Published(what="0.2 mm, 70 °C: contracts at 0.66 A", source="M", value=1.0, unit="s",
              **timed(wire(0.2032), 0.66, "70 °C", "contract")),
    Published(what="0.2 mm, 70 °C: relaxes", source="M", value=3.2, unit="s",
              **timed(wire(0.2032), 0.66, "70 °C", "relax"),
              missing="its transformation temperatures"),
    Published(what="0.25 mm, 70 °C: relaxes", source="M", value=5.4, unit="s",
              **timed(wire(0.254), 1.0, "70 °C", "relax")),
    Published(what="0.51 mm, 90 °C: contracts at 4 A", source="L", value=1.0, unit="s",
              **timed(wire(0.508), 4.0, "90 °C", "contract")),
    Published(what="0.51 mm, 90 °C: relaxes", source="L", value=14.0, unit="s",
              **timed(wire(0.508), 4.0, "90 °C", "relax"),
              missing=_HEAT),
    Published(what="specific heat", source="H", value=450.0, unit="J/(kg K)",
              ours=_parameter("heat_capacity_heating")),
    Published(what="latent heat", source="H", value=1.97e4, unit="J/kg",
              stated=(1.5e4, 1.97e4), ours=_parameter("latent_heating"),
              missing=_HEAT),
)  # fmt: skip


def table() -> str:
    """The table of the page, with its sources."""
    lines = [
        "|published number|source|published|stated|smad|ratio|D's heats|what is missing|",
        "|---|---|---:|---:|---:|---:|---:|---|",
    ]
    for number in NUMBERS:
        ours, ratio = "–", "–"
        if number.ours is not None and number.ratio is not None:
            value = number.ours()
            ours = "never" if math.isinf(value) else f"{value:.3g} {number.unit}"
            ratio = "–" if math.isinf(value) else f"{number.ratio:.2f}"
        mark = " (fitted)" if number.fitted else ""
        published = f"{number.value:.3g} {number.unit}".strip()
        stated = "–".join(f"{bound:.3g}" for bound in number.stated or ())
        warm = (
            ""
            if number.with_heats is None
            else f"{number.with_heats() / number.value:.2f}".replace("inf", "–")
        )
        columns = (published, stated, ours.strip(), ratio, warm, number.missing)
        lines.append(f"|{number.what}{mark}|{number.source}|{'|'.join(columns)}|")
    near, judged = near_of()
    inside, with_interval = inside_of()
    lines += [
        "",
        f"Within {NEAR:.0%}: {near} of {judged} that were not fitted. In the interval that the"
        f" source states: {inside} of {with_interval}, the resistance of wire counted once."
        " *D's heats*: ratio with D's specific and latent heat.",
        "",
    ]
    lines += [f"- {key}: {source}" for key, source in SOURCES.items()]
    return "\n".join(lines)


def near_of() -> tuple[int, int]:
    """How many numbers that the plant computes and was not fitted to are near, and of how many."""
    ratios = [n.ratio for n in NUMBERS if n.ratio is not None and not n.fitted]
    return sum(abs(ratio - 1.0) <= NEAR for ratio in ratios), len(ratios)


def inside_of() -> tuple[int, int]:
    """How many computed numbers lie in the interval that their source states, and how many have
    one. Not those that were fitted; the resistance of wires counts once, for one resistivity."""
    stated = [n for n in NUMBERS if n.stated is not None and n.ours is not None and not n.fitted]
    wires = [n for n in stated if n.unit == "Ω/m"]
    others = [n for n in stated if n.unit != "Ω/m"]
    return sum(n.near for n in others) + all(n.near for n in wires), len(others) + 1


if __name__ == "__main__":
    print(table())
