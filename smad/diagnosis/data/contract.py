"""The contract of a plant, checked with one run: members, shapes, and no state between calls."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from smad.diagnosis.errors import PlantMismatch
from smad.diagnosis.plant import Array, PlantModel, nominal_replay
from smad.diagnosis.runs import GapRun
from smad.errors import SmadError


def require_contract(plant: PlantModel, run: GapRun) -> None:
    """Check `simulate` and `regimes` on a run. Raises PlantMismatch, naming the member at fault.

    The run is replayed twice: a state kept between calls would look like a change of the bench.
    """
    first, second = checked_replay(plant, run), checked_replay(plant, run)
    for name, course in first.items():
        if not np.array_equal(course, second[name], equal_nan=True):
            apart = np.flatnonzero(course != second[name])
            largest = float(np.nanmax(np.abs(course - second[name])))
            raise PlantMismatch(
                f"simulate of plant {plant.name} keeps state between runs: its second replay of "
                f"run {run.name} differs in {name} from {run.t_s[apart[0]]:.6g} s on",
                value=f"a difference of up to {largest:.3g}",
                limit="the same to the last bit",
                action="keep no state from one call to the next, and draw nothing at random",
            )
    for side in dict.fromkeys(("", *(c.side for c in plant.channels))):
        masks = _called(plant, "regimes", run, run, side)
        if not isinstance(masks, Mapping) or "rest" not in masks:
            raise _broken(plant, "regimes", run, "has no mask named rest", _names(masks))
        for name, mask in masks.items():
            if wrong := _other_than(mask, len(run.t_s), "b"):
                raise _broken(plant, "regimes", run, f"gives mask {name} in another form", wrong)


def checked_replay(plant: PlantModel, run: GapRun) -> dict[str, Array]:
    """The nominal prediction of a run by channel, (n,) each. Raises PlantMismatch."""
    outputs = _called(plant, "simulate", run)
    if not isinstance(outputs, Mapping):
        raise _broken(plant, "simulate", run, "gives no mapping", type(outputs).__name__)
    for c in plant.channels:
        if c.name not in outputs:
            raise _broken(plant, "simulate", run, f"lacks channel {c.name}", _names(outputs))
        if wrong := _other_than(outputs[c.name], len(run.t_s), "fiu"):
            raise _broken(plant, "simulate", run, f"gives {c.name} in another form", wrong)
    return {c.name: outputs[c.name] for c in plant.channels}


def _called(plant: PlantModel, member: str, run: GapRun, *arguments: Any) -> Any:
    """What a member of the plant returns for these arguments, or `simulate` for a nominal replay.

    An error of the plant's own breaks the contract.
    """
    try:
        return getattr(plant, member)(*arguments) if arguments else nominal_replay(run, plant)
    except SmadError:
        raise
    except Exception as error:  # whatever somebody else's plant raises
        message = (str(error).splitlines() or [""])[0]
        raise _broken(plant, member, run, "fails", f"{type(error).__name__}: {message}") from error


def _other_than(column: Any, n: int, kinds: str) -> str:
    """What a column is if no array (n,) of one of the dtype `kinds`; else empty."""
    if not isinstance(column, np.ndarray):
        return f"a {type(column).__name__}"
    wrong = column.shape != (n,) or column.dtype.kind not in kinds
    return f"shape {column.shape} of {column.dtype}" if wrong else ""


def _broken(plant: PlantModel, member: str, run: GapRun, fault: str, value: str) -> PlantMismatch:
    return PlantMismatch(
        f"{member} of plant {plant.name} {fault}, for run {run.name}",
        value=value,
        limit=None if fault == "fails" else f"arrays of shape ({len(run.t_s)},), one by each name",
        action="mend the plant; smad docs bring-your-own-plant says what it has to do",
    )


def _names(outputs: Any) -> str:
    return (
        ", ".join(map(str, outputs)) or "nothing" if isinstance(outputs, Mapping) else repr(outputs)
    )
