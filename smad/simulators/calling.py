"""One call of a declared function: what it is given, and whether what it returns can be used."""

from collections.abc import Iterator, Mapping
from types import MappingProxyType

import numpy as np

from smad.diagnosis.plant import Array
from smad.simulators.declare import Simulator


class _Shielded(Mapping[str, Array]):
    """Columns as the function is given them: copies that cannot be written to, made when read."""

    def __init__(self, columns: Mapping[str, Array]) -> None:
        self._columns = columns

    def __getitem__(self, name: str) -> Array:
        return _shielded(self._columns[name])

    def __iter__(self) -> Iterator[str]:
        return iter(self._columns)

    def __len__(self) -> int:
        return len(self._columns)

    def __contains__(self, name: object) -> bool:
        return name in self._columns


def _shielded(column: Array) -> Array:
    view = np.array(column, dtype=np.float64)
    view.flags.writeable = False
    return view


def called(
    declared: Simulator,
    t_s: Array,
    inputs: Mapping[str, Array],
    values: Mapping[str, float],
    start: Mapping[str, float],
) -> dict[str, Array]:
    """One call of the function, its arguments read-only: outputs by name, (n,) each.

    Raises what the function raises, and ValueError for outputs that are no (n,) of numbers.
    """
    t = _shielded(t_s - t_s[0])
    shielded = _Shielded(inputs)
    try:
        with np.errstate(all="ignore"):
            outputs = declared.function(t, shielded, MappingProxyType(dict(values)), start)
    except SystemExit as ended:
        raise ValueError(f"it ends the program: SystemExit({ended.code!r})") from ended
    if not isinstance(outputs, Mapping):
        raise ValueError(f"it returns {type(outputs).__name__}, not outputs by name")
    out = {}
    for name, column in outputs.items():
        if np.iscomplexobj(column):
            raise ValueError(f"{name} is complex")
        y = np.asarray(column, dtype=np.float64)
        if y.shape != t.shape:
            raise ValueError(f"{name} has shape {y.shape}; the run has {t.shape}")
        out[str(name)] = y
    return out
