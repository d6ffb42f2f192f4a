"""How uncertain the values of a model file are, together: one covariance matrix over named values.

A name is that of the table it stands in: `parameters.martensite_start`, `effects.rtd_lag.tau_s`,
`mounting.side_resistance`. Units are those of the file, SI.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from sim_device.plant.errors import ModelError
from sim_device.plant.textfile import quoted

Array = npt.NDArray[np.float64]
_NEGATIVE = 1e-9
"""Most that rounding may leave of a negative eigenvalue, of correlations."""


@dataclass(frozen=True, eq=False)
class Covariance:
    """Names (k,) and their covariance, shape (k, k), symmetric and positive semi-definite.

    Raises ModelError for what is not that, in a line.
    """

    names: tuple[str, ...]
    matrix: Array

    def __post_init__(self) -> None:
        k = len(self.names)
        if k == 0 or len(set(self.names)) != k:
            raise ModelError("covariance: names must be given, each of them once")
        if self.matrix.shape != (k, k):
            raise ModelError(
                f"covariance: {k} names, and a matrix of shape {self.matrix.shape};"
                " give a row for each name"
            )
        if not np.isfinite(self.matrix).all():
            raise ModelError("covariance: a number of the matrix is not finite")
        self._check_definite()

    def _check_definite(self) -> None:
        diagonal = np.diag(self.matrix)
        if (diagonal < 0.0).any():
            name = self.names[int(np.argmin(diagonal))]
            raise ModelError(f"covariance: the variance of {name} is negative")
        deviation = np.sqrt(diagonal)
        of_correlations = np.outer(deviation, deviation)
        apart = np.abs(self.matrix - self.matrix.T) > 1e-9 * of_correlations
        if apart.any():
            i, j = (int(v) for v in np.argwhere(apart)[0])
            raise ModelError(
                f"covariance: that of {self.names[i]} with {self.names[j]} is given twice,"
                " differently; the matrix must be symmetric"
            )
        correlation = np.divide(
            self.matrix, of_correlations, out=np.zeros_like(self.matrix), where=of_correlations > 0
        )
        alone = (of_correlations == 0.0) & (self.matrix != 0.0)
        least = float(np.linalg.eigvalsh(0.5 * (correlation + correlation.T)).min())
        if alone.any() or least < -_NEGATIVE * len(self.names):
            raise ModelError(
                f"covariance: the matrix is not positive semi-definite (least eigenvalue of the"
                f" correlations {least:.3g}); no values can vary like that"
            )

    @property
    def deviations(self) -> dict[str, float]:
        """Standard deviation of each value."""
        deviations = np.sqrt(np.diag(self.matrix)).tolist()
        return dict(zip(self.names, deviations, strict=True))

    def steps(self, rng: np.random.Generator) -> dict[str, float]:
        """Normal deviations from the values, drawn together."""
        scale = np.sqrt(np.diag(self.matrix))
        safe = np.where(scale > 0.0, scale, 1.0)
        # Of correlations, since the values span many powers of ten.
        values, vectors = np.linalg.eigh(self.matrix / np.outer(safe, safe))
        root = vectors * np.sqrt(np.maximum(values, 0.0))
        drawn = scale * (root @ rng.standard_normal(len(self.names)))
        return dict(zip(self.names, drawn.tolist(), strict=True))


def read_covariance(raw: Mapping[str, Any], known: Collection[str]) -> Covariance:
    """The covariance of a model file's table: `names`, and `matrix` as rows, whole or the lower
    triangle.

    known: the values that the file has. Raises ModelError.
    """
    unknown = sorted(set(raw) - {"names", "matrix"})
    if unknown:
        raise ModelError(f"covariance: unknown key {unknown[0]!r}; known are matrix, names")
    names, rows = raw.get("names"), raw.get("matrix")
    if not isinstance(names, list) or not all(isinstance(name, str) for name in names):
        raise ModelError("covariance: names must be a list of texts")
    strange = [name for name in names if name not in known]
    if strange:
        raise ModelError(f"covariance: the model has no value {strange[0]!r}")
    if not isinstance(rows, list) or not all(isinstance(row, list) for row in rows):
        raise ModelError("covariance: matrix must be a list of rows")
    if not all(isinstance(v, int | float) and not isinstance(v, bool) for row in rows for v in row):
        raise ModelError("covariance: the matrix must hold numbers only")
    return Covariance(tuple(names), _square(rows))


def _square(rows: Sequence[Sequence[float]]) -> Array:
    k = len(rows)
    if [len(row) for row in rows] == list(range(1, k + 1)):
        matrix = np.zeros((k, k))
        for i, row in enumerate(rows):
            matrix[i, : i + 1] = row
            matrix[: i + 1, i] = row
        return matrix
    if any(len(row) != k for row in rows):
        raise ModelError(
            "covariance: the rows of the matrix are neither those of a square nor of its lower"
            " triangle"
        )
    return np.array(rows, dtype=np.float64)


def plain(covariance: Covariance) -> dict[str, Any]:
    """The table that `read_covariance` reads, with the lower triangle."""
    rows = covariance.matrix.tolist()
    return {
        "names": list(covariance.names),
        "matrix": [row[: i + 1] for i, row in enumerate(rows)],
    }


def toml_lines(table: Mapping[str, Any]) -> list[str]:
    """The lines of the table in a model file."""
    return [
        "[covariance]",
        f"names = [{', '.join(quoted(name) for name in table['names'])}]",
        "matrix = [",
        *(f"    [{', '.join(map(repr, row))}]," for row in table["matrix"]),
        "]",
    ]
