"""Check before you measure: what runs with these inputs could show of each parameter and cause.

Of every parameter, effect and place the nominal model says what it would change of the readings.
What other values of the parameters imitate within their ranges is taken off by least squares with
their priors, as in a diagnosis; what is left is compared with the floor of a reading, and with what
the others leave.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, Literal

import numpy as np
from scipy.optimize import lsq_linear

from sim_device.plant.errors import PlantError
from smad.counted import listed
from smad.diagnosis.data.columns import filled
from smad.diagnosis.data.grid import Grid, row_length_s, thinned
from smad.diagnosis.data.noise import RESOLUTION, excursion
from smad.diagnosis.places.bare import with_places
from smad.diagnosis.places.place import PlacesPlant
from smad.diagnosis.plant import Array, ModelPoint, PlantModel, nominal_point
from smad.diagnosis.rivals.evidence import CORRELATED
from smad.diagnosis.runs import GapRun
from smad.progress import Say, silent

Rated = Literal["identifiable", "weak", "not", "unknown"]
IDENTIFIABLE: Rated = "identifiable"
WEAK: Rated = "weak"
NOT: Rated = "not"
UNKNOWN: Rated = "unknown"
_OF_SCALE = {True: 100.0, False: 30.0}
"""Times the scale of a place, a reading or not, that a law there may well be."""
_ALIKE = 0.95
"""Squared cosine of what two causes leave from which runs do not tell them apart."""
_THETA_STEP = 0.1
_NAMED = 3
"""Names of what is unknown for one reason, in words."""
_SURE, _LITTLE = 0.3, 0.8
"""Of the prior's deviation, what runs must leave of it for a parameter to be identifiable, weak."""
_PIECES = 5
_FAR = 1.5
"""Prior deviations by which a parameter may well imitate a cause: farther, it is no likelier."""
_HALVINGS = 10
"""Of a size, which is then known to a thousandth of the range."""
_LATE, _NO_NUMBERS = (
    "not reached in the time; give more: within_s = 60 (--within 60)",
    "the model gives no numbers with it",
)
LEAST_S = 0.5
"""For replays, however long it took to come to them."""


@dataclass(frozen=True, kw_only=True)
class Rating:
    """What these inputs show of one parameter, effect or place.

    `size` is from where on it would be noticed, in `unit`: where the parameters leave one floor of
    it; infinite where nothing of it shows. `alike` are causes elsewhere that look the same. A cause
    is *identifiable* that is noticed below its typical size and looks like no other, *weak* that is
    noticed within its range, and *not* that is not; `why` says why one is *unknown*.
    """

    kind: Literal["parameter", "effect", "place"]
    name: str
    words: str
    rating: Rated
    size: float
    unit: str
    alike: tuple[str, ...] = ()
    why: str = ""


@dataclass(frozen=True, kw_only=True)
class _Cause:
    """An effect or a place; `play` returns what `step` of it changes, None if it cannot be run."""

    kind: Literal["effect", "place"]
    name: str
    words: str
    unit: str
    step: float
    typical: float
    high: float
    places: frozenset[str]
    play: Callable[[], Array | None]


def rate(
    plant: PlantModel,
    runs: Sequence[GapRun],
    *,
    within_s: float = 5.0,
    progress: Say = silent,
) -> list[Rating]:
    """Rate every parameter, effect and place for runs with these inputs, without any reading.

    Readings that the runs have are not used. What is not reached `within_s` is *unknown*.
    """
    placed = with_places(plant)
    sheet = _Sheet.of(placed, [filled(r) for r in runs])
    # The first replay of all may have compiled a kernel.
    ends = time.process_time() + within_s
    progress("what each parameter changes")
    slopes, missed_by = _slopes(sheet, ends)
    gram = slopes @ slopes.T / CORRELATED + np.eye(len(slopes))
    played, missed = list[tuple[_Cause, Array]](), list[Rating]()
    for c in (*_effects(sheet), *_places(sheet)):
        progress(f"what {c.name} changes")
        late = time.process_time() > ends
        rows = None if late else c.play()
        if rows is None:
            missed.append(_rated(c, UNKNOWN, np.inf, why=_LATE if late else _NO_NUMBERS))
        else:
            played.append((c, rows))
    progress("what the parameters imitate")
    causes = [c for c, _ in played]
    noticed = [_noticed(c, rows, sheet, slopes, gram) for c, rows in played]
    left = [rows for _, rows in noticed]
    rated = []
    for k, (c, (size, _)) in enumerate(zip(causes, noticed, strict=True)):
        alike = _alike(k, causes, left)
        rating = NOT if size > c.high else WEAK if alike or size > c.typical else IDENTIFIABLE
        rated.append(_rated(c, rating, size, alike=alike))
    return [*_parameters(placed, slopes, gram, missed_by), *rated, *missed]


def _noticed(
    c: _Cause, rows: Array, sheet: _Sheet, slopes: Array, gram: Array
) -> tuple[float, Array]:
    """From what size on the parameters leave one floor of a cause, and rows that they leave.

    They imitate a cause by least squares with their priors, and neither beyond their ranges nor
    farther than is likely: of a cause that asks for more they leave what is over.
    """
    pull = slopes @ rows / CORRELATED
    x = np.linalg.solve(gram, pull)
    left = rows - slopes.T @ x
    floors = sheet.size(left)
    times, most = 1.0 / floors if floors > 0.0 else np.inf, c.high / c.step
    q = sheet.plant.parameters
    ends = [[(end - p.nominal) / p.prior_sd for p in q for end in (p.low, p.high)]]
    box = np.clip(np.reshape(ends, (-1, 2)).T, -_FAR, _FAR)
    coordinates = min(times, most) * x
    if np.all((box[0] <= coordinates) & (coordinates <= box[1])):
        return c.step * times, left
    root = np.linalg.cholesky(gram)

    def beyond(scale: float) -> Array:
        y = lsq_linear(root.T, np.linalg.solve(root, scale * pull), bounds=box).x
        return np.asarray(scale * rows - slopes.T @ y)

    low, high = 0.0, min(times, most)
    if sheet.size(beyond(high)) < 1.0:
        return c.step * times, left
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        low, high = (low, middle) if sheet.size(beyond(middle)) >= 1.0 else (middle, high)
    return c.step * high, beyond(high)


def _rated(c: _Cause, rating: Rated, size: float, **more: Any) -> Rating:
    size = float(size)
    return Rating(
        kind=c.kind, name=c.name, words=c.words, rating=rating, size=size, unit=c.unit, **more
    )


def _alike(k: int, causes: Sequence[_Cause], left: Sequence[Array]) -> tuple[str, ...]:
    """Causes at other places whose rows are nearly those of a cause, up to their size."""
    cause, square = causes[k], float(left[k] @ left[k])
    alike = []
    for other, rows in zip(causes, left, strict=True):
        # An effect that may be anywhere is nowhere else.
        both_placed = bool(cause.places and other.places)
        if both_placed and other.kind == cause.kind and not cause.places & other.places:
            both = square * float(rows @ rows)
            if both > 0.0 and float(left[k] @ rows) ** 2 > _ALIKE * both:
                alike.append(other.name)
    return tuple(alike)


def _parameters(
    plant: PlantModel, slopes: Array, gram: Array, missed_by: Sequence[str]
) -> list[Rating]:
    """Each parameter by what runs leave of its prior deviation, the others free."""
    spread = np.sqrt(np.diag(np.linalg.inv(gram)))
    size = np.sqrt(CORRELATED * np.maximum(spread**-2 - 1.0, 0.0) / max(slopes.shape[1], 1))
    out = []
    for q, sd, rows, why in zip(plant.parameters, spread, size, missed_by, strict=True):
        rating = IDENTIFIABLE if sd < _SURE else WEAK if sd < _LITTLE else NOT
        noticed = q.prior_sd / rows if rows > 0.0 else np.inf
        out.append(
            Rating(
                kind="parameter",
                name=q.name,
                words=q.name,
                rating=UNKNOWN if why else rating,
                size=float(noticed),
                unit=q.unit,
                why=why,
            )
        )
    return out


@dataclass(frozen=True)
class _Sheet:
    """Runs of a plant as rows: every channel's means over a row, in its floors."""

    plant: PlacesPlant
    runs: tuple[GapRun, ...]
    grids: tuple[Grid, ...]
    floors: Array
    base: Array

    @classmethod
    def of(cls, plant: PlacesPlant, runs: Sequence[GapRun]) -> _Sheet:
        point = nominal_point(plant)
        outputs = [plant.simulate(point, r) for r in runs]
        as_read = [replace(r, outputs=y) for r, y in zip(runs, outputs, strict=True)]
        period_s = row_length_s(as_read, plant)
        measured = tuple(r if r.outputs else a for r, a in zip(runs, as_read, strict=True))
        per_row = max(period_s / max(np.median([r.dt_s for r in runs]), 1e-9), 1.0)
        floors = []
        for c in plant.channels:
            noise = max(c.noise / np.sqrt(per_row), c.quantum / np.sqrt(12.0))
            resolution = RESOLUTION * excursion([y[c.name] for y in outputs])
            floors.append(np.hypot(noise, resolution) or 1.0)
        quick = tuple(thinned(r, period_s / _PIECES, plant.inputs) for r in measured)
        bare = cls(
            plant, quick, tuple(Grid.of(r, period_s) for r in quick), np.array(floors), np.zeros(0)
        )
        return replace(bare, base=bare._rows([plant.simulate(point, r, fast=True) for r in quick]))

    def _rows(self, outputs: Sequence[Mapping[str, Array]]) -> Array:
        parts = [
            grid.mean(y[c.name]) / floor
            for grid, y in zip(self.grids, outputs, strict=True)
            for c, floor in zip(self.plant.channels, self.floors, strict=True)
        ]
        return np.concatenate(parts)

    def size(self, rows: Array) -> float:
        """Root mean square of rows, in floors."""
        return float(np.sqrt(np.mean(rows**2)))

    def changes_at(self, point: ModelPoint) -> Array | None:
        """What a point changes of the nominal readings, (rows,); None where it cannot be run."""
        return self._less([self.plant.simulate(point, r, fast=True) for r in self.runs])

    def forced(self, place: str, side: str, size: float) -> Array | None:
        """What a constant of that size changes at a place."""
        point = nominal_point(self.plant)
        try:
            outputs = [
                self.plant.forced(point, r, {(place, side): np.full(len(r.t_s), size)}, fast=True)
                for r in self.runs
            ]
        except PlantError:
            return None
        return self._less(outputs)

    def _less(self, outputs: Sequence[Mapping[str, Array]]) -> Array | None:
        moved = self._rows(outputs) - self.base
        return moved if np.isfinite(moved).all() else None


def _slopes(sheet: _Sheet, ends: float) -> tuple[Array, list[str]]:
    """Rows for a prior standard deviation of each parameter, (parameters, rows); why there are none
    of it, or an empty text."""
    out = np.zeros((len(sheet.plant.parameters), len(sheet.base)))
    missed_by = [_LATE] * len(out)
    for i, q in enumerate(sheet.plant.parameters):
        if time.process_time() > ends:
            break
        step = _THETA_STEP * q.prior_sd * (1.0 if q.nominal + q.prior_sd <= q.high else -1.0)
        point = nominal_point(sheet.plant)
        moved = sheet.changes_at(replace(point, theta={**point.theta, q.name: q.nominal + step}))
        missed_by[i] = _NO_NUMBERS if moved is None else ""
        if moved is not None:
            out[i] = moved * (q.prior_sd / step)
    return out, missed_by


def _effects(sheet: _Sheet) -> Iterator[_Cause]:
    """Each strength of each effect at its typical value, the shapes typical."""
    places = frozenset(p.name for p in sheet.plant.places)
    for effect in sheet.plant.effects:
        for q in (p for p in effect.parameters if p.strength):
            name = effect.name if q.name in ("size", "g", "b") else f"{effect.name}.{q.name}"
            values = {p.name: 0.0 if p.strength else p.typical for p in effect.parameters}
            point = nominal_point(sheet.plant)
            with_effect = replace(point, effects={effect.name: {**values, q.name: q.typical}})
            yield _Cause(
                kind="effect",
                name=name,
                words=effect.title,
                unit=q.unit,
                step=abs(q.typical),
                typical=abs(q.typical),
                high=max(abs(q.low), abs(q.high)),
                places=places & frozenset(effect.places),
                play=partial(sheet.changes_at, with_effect),
            )


def _places(sheet: _Sheet) -> Iterator[_Cause]:
    """A constant at each place and side."""
    for place in sheet.plant.places:
        for side in place.sides:
            name = place.name if len(place.sides) < 2 else f"{place.name} {side.upper()}"
            words = place.label if len(place.sides) < 2 else f"{place.label}, {side.upper()}"
            most = _OF_SCALE[place.reading] * place.scale
            yield _Cause(
                kind="place",
                name=name,
                words=words,
                unit=place.unit,
                step=place.scale,
                typical=most,
                high=most,
                places=frozenset({place.name}),
                play=partial(sheet.forced, place.name, side, place.scale),
            )


def lines(ratings: Sequence[Rating]) -> list[str]:
    """Ratings in words, by kind: what shows best first."""
    order = {IDENTIFIABLE: 0, WEAK: 1, NOT: 2, UNKNOWN: 3}
    out = []
    for kind, head in (
        ("parameter", "parameters"),
        ("effect", "effects"),
        ("place", "places, a law that is always there"),
    ):
        rows = sorted((r for r in ratings if r.kind == kind), key=lambda r: order[r.rating])
        if rows:
            out.append(head)
        unknown: dict[str, list[str]] = {}
        for r in rows:
            named = r.words if kind == "place" else r.name
            if r.rating == UNKNOWN:
                unknown.setdefault(r.why, []).append(named)
                continue
            like = f"; looks like {', '.join(r.alike[:3])}" if r.alike else ""
            out.append(f"  {r.rating:<12} {named}: {_size(r)}{like}")
        out += [f"  {UNKNOWN:<12} {listed(names, _NAMED)}: {why}" for why, names in unknown.items()]
    return out


def _size(r: Rating) -> str:
    if not np.isfinite(r.size) or r.size > 1e12:
        return "nothing of it shows"
    unit = f" {r.unit}" if r.unit not in ("", "1") else ""
    text = f"{100 * r.size:.2g} %" if r.unit == "1" else f"{r.size:.2g}{unit}"
    return f"noticed from {text} on"
