"""Columns of a run log as a pandas DataFrame."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from numpy.typing import NDArray

from smad.extras import part
from smad.runlog.schema import CHANNELS, LEGENDS

if TYPE_CHECKING:
    import pandas


def data_frame(
    columns: Mapping[str, NDArray[Any]], recorded: Mapping[str, NDArray[Any]]
) -> pandas.DataFrame:
    """The columns, each of shape (n,), where they are `recorded`; by board time.

    Raises MissingPartError without pandas.
    """
    pd = part("pandas")
    frame: pandas.DataFrame = pd.DataFrame(
        {name: _series(pd, name, column, recorded[name]) for name, column in columns.items()}
    )
    frame.attrs["units"] = {name: CHANNELS[name].unit for name in columns}
    return frame.set_index("t_s") if "t_s" in columns else frame


def _series(pd: Any, name: str, column: NDArray[Any], recorded: NDArray[Any]) -> Any:
    series = pd.Series(column)
    if CHANNELS[name].kind == "float":
        return series
    series = series.astype("Int64").where(recorded)
    legend = LEGENDS.get(name)
    if legend is None:
        return series
    # A number that a newer board sends and we have no word for stays a number.
    words = series.map(lambda number: legend.get(number, str(number)), na_action="ignore")
    return words.astype("category")
