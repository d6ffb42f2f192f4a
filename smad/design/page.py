"""The page of a design."""

from __future__ import annotations

from dataclasses import asdict

from sim_device.plant.geometry import Geometry
from smad.design.cycle import Design
from smad.report.page import Page, Section, Table, Text

_HEADER = ("quantity", "value")
_ALLOY = (
    "The alloy is not scaled; its published numbers beside those of other laboratories are in "
    "docs/physics.md."
)


def design_page(
    design: Design,
    geometry: Geometry,
    alloy: str,
    *,
    current_A: float,
    cooling: str,
    air_m_per_s: float = 0.0,
) -> Page:
    """Return the page: what the pair gives, and for what geometry, current and cooling."""
    sizes = [(name, f"{value:g}") for name, value in asdict(geometry).items() if value is not None]
    fan = [("air_m_per_s", f"{air_m_per_s:g}")] if air_m_per_s else []
    sizes += [("current_A", f"{current_A:g}"), ("cooling", cooling), *fan, ("alloy", alloy)]
    return Page(
        title="Design of a pair of springs",
        lead="What the simulated pair gives over a full stroke to and fro.",
        facts=[],
        sections=[
            Section("What it gives", [Table(_HEADER, design.rows())]),
            Section(
                "For this geometry",
                [
                    Table(_HEADER, sizes),
                    *(Text(f"Outside what was checked: {remark}.") for remark in design.outside),
                    Text(_ALLOY, kind="note"),
                ],
            ),
        ],
    )
