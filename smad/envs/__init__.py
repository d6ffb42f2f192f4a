"""The spring pair as a Gymnasium environment, and policies of it on a bench.

`import smad.envs` registers `smad/SpringPair-v0`; what it is made of is loaded by
`gymnasium.make`, and by the first use of a name below.
"""

import importlib
from typing import TYPE_CHECKING, Any

from smad.extras import part

if TYPE_CHECKING:
    from smad.envs.bench import on_bench
    from smad.envs.pair import Degrees, SpringPairEnv
    from smad.envs.vector import SpringPairVectorEnv

NAME = "smad/SpringPair-v0"
_HOMES = {
    "Degrees": "pair",
    "SpringPairEnv": "pair",
    "SpringPairVectorEnv": "vector",
    "on_bench": "bench",
}
__all__ = ["NAME", "Degrees", "SpringPairEnv", "SpringPairVectorEnv", "on_bench"]


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(importlib.import_module(f"{__name__}.{_HOMES[name]}"), name)


def _register() -> None:
    gymnasium = part("gymnasium")
    if NAME not in gymnasium.registry:
        gymnasium.register(
            NAME,
            entry_point="smad.envs.pair:SpringPairEnv",
            vector_entry_point="smad.envs.vector:SpringPairVectorEnv",
        )


_register()
