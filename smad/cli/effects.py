"""The values of effects that are named on the command line."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping


def effect_lines(effects: Mapping[str, Mapping[str, float]], named: Iterable[str]) -> Iterator[str]:
    """Yield a line for each effect of `named` (NAME or NAME:P=V): its values with their units."""
    from sim_device.plant.effects.registry import effect

    for text in named:
        name = text.partition(":")[0].strip()
        entry, values = effect(name), effects[name]
        told = ", ".join(
            f"{p.name} = {values[p.name]:g} {'' if p.unit == '1' else p.unit}".rstrip()
            for p in entry.parameters
        )
        yield f"effect {name}: {told}"
