"""The spring pair's traits: the parameters of a day, and what measures its surroundings."""

from __future__ import annotations

from smad.diagnosis.plant import Traits

TRAITS = Traits(
    day={
        "tube_loss": 0.15,
        "flow_max": 0.15,
        "film_scale": 0.15,
        "water_temperature": 0.03,
        "ambient_temperature": 0.03,
        "initial_deflection": 0.1,
        "displacement_zero": 0.1,
    },
    environment={
        "water_temperature": "rtd_inlet_degC",
        "ambient_temperature": "rtd_ambient_degC",
    },
    drift={"inlet_water": 0.2, "ambient_air": 0.2},
)
"""Loss, flow, film, temperatures beyond what is measured, and where a run starts from. Water and
room wander within a run."""
