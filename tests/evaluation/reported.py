"""A cause as a verdict has it, for tests of what reads verdicts."""

from __future__ import annotations

from smad.diagnosis.verdict import Cause


def effect_reported(name: str, place: str, *, gap: float = 1.0) -> Cause:
    """An effect of the library that is sure by name and place."""
    return Cause(
        kind="effect",
        name=name,
        place=place,
        words=place,
        probability=1.0,
        names={name: 1.0},
        outside=0.0,
        credible_names=[name],
        credible_places=[place],
        places={place: 1.0},
        place_words={place: place},
        values=[],
        terms=[],
        unit="",
        gap=gap,
        rivals=[],
    )
