"""Model files, TOML and JSON: refused in words, or parameters and effects within their ranges."""

from __future__ import annotations

from campaign.fuzz.files import file_with, no_file
from campaign.fuzz.parameters import within_limits
from campaign.fuzz.program import require
from sim_device.plant.constants import VARIANTS
from sim_device.plant.effects.registry import effect
from sim_device.plant.errors import PlantError
from sim_device.plant.models import read_model, save_model

_KINDS = ("model.toml", "model.json")


def run(data: bytes) -> None:
    """The first byte chooses TOML or JSON, the rest is the file."""
    name = _KINDS[data[0] & 1] if data else _KINDS[0]
    try:
        model = read_model(file_with(name, data[1:]))
    except PlantError as error:
        require(str(error).strip(), "a refusal without words")
        return
    require(model.variant in VARIANTS, "{!r} is no variant", model.variant)
    within_limits(model.parameters)
    for key, values in model.effects.items():
        for parameter in effect(key).parameters:
            require(
                parameter.low <= values[parameter.name] <= parameter.high,
                "{}.{} is out of range",
                key,
                parameter.name,
            )
    for other in _KINDS:
        path = no_file(f"again-{other}")
        save_model(
            path,
            base=model.base,
            variant=model.variant,
            overrides=model.overrides,
            effects=model.effects,
            note=model.note,
        )
        again = read_model(path)
        require(
            (again.parameters, again.variant, again.effects, again.note)
            == (model.parameters, model.variant, model.effects, model.note),
            "saved as {} it reads otherwise",
            other,
        )
