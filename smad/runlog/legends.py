"""What the numbers of some channels stand for."""

from collections.abc import Mapping

from firmware_protocol.enums import BoardState, Limiter

LEGENDS: Mapping[str, Mapping[int, str]] = {
    "mode": {state.value: state.name for state in BoardState},
    "limiter": {limiter.value: limiter.name.lower() for limiter in Limiter},
}
"""By channel, in the words of `smad status`."""
