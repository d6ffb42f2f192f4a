"""Effects as text: NAME[:param=value,…], as the command line takes them."""

from __future__ import annotations

from collections.abc import Iterable

from sim_device.plant.effects.registry import Resolved, resolve
from sim_device.plant.errors import EffectError


def parse_effects(texts: str | Iterable[str]) -> Resolved:
    """Effects from NAME[:param=value,…], one text or several; completed and checked.

    Raises EffectError for text of another form, and as `resolve` does.
    """
    values: dict[str, dict[str, float]] = {}
    for text in [texts] if isinstance(texts, str) else texts:
        name, _, rest = text.strip().partition(":")
        if name in values:
            raise EffectError(f"effect {name!r} is given twice; give all its parameters at once")
        values[name] = dict(_pair(text, part) for part in rest.split(",") if part.strip())
    return resolve(values)


def _pair(text: str, part: str) -> tuple[str, float]:
    key, equals, value = part.partition("=")
    try:
        if not equals:
            raise ValueError
        return key.strip(), float(value)
    except ValueError:
        raise EffectError(
            f"{text!r}: {part.strip()!r} is not param=value; write NAME:param=value,param=value"
        ) from None


def format_effects(effects: Resolved) -> list[str]:
    """The texts that `parse_effects` reads back."""
    return [
        ":".join([name, ",".join(f"{key}={value!r}" for key, value in values.items())])
        for name, values in effects.items()
    ]
