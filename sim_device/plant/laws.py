"""Laws: what is missing at a place, as a linear combination of functions of the plant's own states.

A term is a coefficient times up to two factors; a factor is a function of one state, or of what a
first-order lag of 1 or 10 s makes of it. States are clamped to the support that the law was learned
on, so that a law stays at its last value beyond it. The kernel evaluates laws from its own states;
`basis` evaluates the same terms on those of a recorded trajectory.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np
import numpy.typing as npt

from sim_device.plant.errors import InputError
from sim_device.plant.places import SLOTS, STATE_NAMES, STATES, keys_of, place

Array = npt.NDArray[np.float64]
Support = Mapping[str, tuple[float, float]]
"""Lowest and highest value of each state that a law was learned on."""

KINDS = {"line": 1, "bend": 2, "hat": 3, "sign": 4}
"""z, max(z, 0), max(1 - |z|, 0), tanh(z), of z = (state - centre)/scale."""
LAGS_S = (1.0, 10.0)
MOST_TERMS = 2048
"""Terms of all laws of a plant together, a law of both springs counting twice."""
REST_SPEED = 5e-5
"""m/s at which the sign of a velocity is three quarters of itself."""
_BENDS = (1.0 / 3.0, 2.0 / 3.0)
_NAME = re.compile(r"[a-z][a-z0-9_]*\Z")


@dataclass(frozen=True, kw_only=True)
class Factor:
    """A function of one state: `kind` of (state - centre)/scale, the state clamped to low..high."""

    state: str
    kind: str = "line"
    lag_s: float = 0.0
    low: float
    high: float
    centre: float
    scale: float


@dataclass(frozen=True, kw_only=True)
class Term:
    """A basis function with its coefficient, which has the unit of the place.

    No factor is a constant, two are multiplied. order: 1 for a constant or a straight line, 2 for
    what bends it, 3 for lags and products; a selection prefers lower ones.
    """

    name: str
    factors: tuple[Factor, ...] = ()
    coefficient: float = 1.0
    order: int = 1


@dataclass(frozen=True)
class Law:
    """What is added at a place. `side`: "x", "y", or "both" (the same law on each spring's own)."""

    place: str
    side: str
    terms: tuple[Term, ...]

    def with_coefficients(self, values: Sequence[float]) -> Law:
        """The same terms with these coefficients, in their order."""
        pairs = zip(self.terms, values, strict=True)
        return replace(self, terms=tuple(replace(t, coefficient=float(v)) for t, v in pairs))

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the coefficients in a model file's covariance."""
        return tuple(self.name_of(term) for term in self.terms)

    def name_of(self, term: Term) -> str:
        """Name of the coefficient of a term there."""
        return f"laws.{self.place}.{self.side}.{term.name}"


def joined(laws: Iterable[Law]) -> tuple[Law, ...]:
    """The laws with one for each place and side; terms of one name add up.

    Terms of one name at a place must be the same function, as those of one space are.
    """
    terms: dict[tuple[str, str], dict[str, Term]] = {}
    for law in laws:
        by_name = terms.setdefault((law.place, law.side), {})
        for term in law.terms:
            earlier = by_name.get(term.name)
            more = 0.0 if earlier is None else earlier.coefficient
            by_name[term.name] = replace(term, coefficient=term.coefficient + more)
    return tuple(Law(*key, tuple(by_name.values())) for key, by_name in terms.items())


def terms_over(
    states: Sequence[str],
    support: Support,
    *,
    bends: bool = True,
    lags: bool = True,
    products: bool = True,
    signed: Sequence[str] = ("velocity",),
) -> tuple[Term, ...]:
    """Candidate terms by rule, coefficients 0.

    A constant; of each state a straight line and two bends at thirds of its support (truncated
    linear spline), of those `signed` their sign; of each state its lags of 1 and 10 s; of each pair
    of states the product of their straight lines. States that do not vary are left out. Lines run
    from -1 to 1 over the support. Raises InputError for a support that is not finite.
    """
    lines: dict[str, Factor] = {}
    for state in states:
        if state not in support:
            continue
        low, high = (float(bound) for bound in support[state])
        if not (math.isfinite(low) and math.isfinite(high)) or low > high:
            raise InputError(f"support of {state} is {low:g} to {high:g}; give finite low <= high")
        if high - low > 1e-9 * max(abs(low), abs(high)):
            lines[state] = Factor(
                state=state,
                low=low,
                high=high,
                centre=0.5 * (low + high),
                scale=0.5 * (high - low),
            )
    terms = [Term(name="constant", coefficient=0.0)]

    def add(name: str, order: int, *factors: Factor) -> None:
        terms.append(Term(name=name, factors=factors, coefficient=0.0, order=order))

    for state, line in lines.items():
        add(state, 1, line)
    for state, line in lines.items():
        if bends:
            for n, share in enumerate(_BENDS, 1):
                knot = line.low + share * (line.high - line.low)
                add(f"{state}_bend{n}", 2, replace(line, kind="bend", centre=knot))
        if state in signed:
            # Friction; a line cannot stand for it.
            speed = REST_SPEED if state == "velocity" else 0.01 * line.scale
            add(f"{state}_sign", 2, replace(line, kind="sign", centre=0.0, scale=speed))
        if lags and state != "time":
            for lag_s in LAGS_S:
                add(f"{state}_lag{lag_s:g}", 3, replace(line, lag_s=lag_s))
    if products:
        for (first, line), (other, second) in combinations(lines.items(), 2):
            add(f"{first}_x_{other}", 3, line, second)
    return tuple(terms)


def own_states(place_name: str, side: str, states: Mapping[str, Array]) -> dict[str, Array]:
    """States of a trajectory as a place on a side sees them, by name of STATES.

    states: by "name.x", "name.y" or "name" (see `trajectory_outputs` of the replay). A side "both"
    is seen from X. Those that the trajectory lacks are left out.
    """
    entry = place(place_name)
    this, other = ("y", "x") if side == "y" else ("x", "y")
    sign = -1.0 if this == "y" else 1.0
    seen: dict[str, Array] = {}
    for state in entry.states:
        if state.startswith("other_"):
            key = f"{state.removeprefix('other_')}.{other}"
        elif state in ("displacement", "velocity", "time"):
            key = state
        elif state == "reading":
            key = f"{place_name}.{side}"
        elif state == "reading_rate":
            key = f"{place_name}_rate.{side}"
        else:
            key = f"{state}.{this}"
        if key in states:
            flips = state in ("displacement", "velocity") and sign < 0.0
            values = np.asarray(states[key], dtype=np.float64)
            seen[state] = -values if flips else values
    return seen


def lagged(values: Array, t_s: Array, lag_s: float) -> Array:
    """A first-order lag of samples, shape (n,), that starts at the first of them."""
    # Here, because the text of a law needs no kernel.
    from sim_device.plant import kernel

    out = np.empty(len(values))
    shares = 1.0 - np.exp(-np.diff(t_s) / lag_s)
    kernel.lag_samples(np.ascontiguousarray(values), shares, len(values), out)
    return out


def evaluate_factor(factor: Factor, values: Array) -> Array:
    """The function of a factor at values of its state, lagged already where it asks for it."""
    z = (np.clip(values, factor.low, factor.high) - factor.centre) / factor.scale
    if factor.kind == "line":
        return np.asarray(z)
    if factor.kind == "bend":
        return np.maximum(z, 0.0)
    if factor.kind == "hat":
        return np.maximum(1.0 - np.abs(z), 0.0)
    return np.tanh(z)


def basis(seen: Mapping[str, Array], terms: Sequence[Term], t_s: Array) -> Array:
    """Basis functions of terms on the states that a place sees, by name; shape (n, k).

    Raises InputError for a state that is not there.
    """
    cached: dict[tuple[str, float], Array] = {}

    def of(factor: Factor) -> Array:
        which = (factor.state, factor.lag_s)
        if which not in cached:
            if factor.state not in seen:
                raise InputError(
                    f"the trajectory has no state {factor.state!r}; it has {', '.join(seen)}"
                )
            values = seen[factor.state]
            cached[which] = lagged(values, t_s, factor.lag_s) if factor.lag_s > 0.0 else values
        return evaluate_factor(factor, cached[which])

    out = np.ones((len(t_s), len(terms)))
    for column, term in enumerate(terms):
        for factor in term.factors:
            out[:, column] *= of(factor)
    return out


def check_laws(laws: Sequence[Law]) -> None:
    """Raise InputError for a law that the kernel cannot take; the message names it."""
    count = 0
    seen: set[tuple[str, str]] = set()
    for law in laws:
        where = f"law at {law.place!r}, side {law.side!r}"
        count += len(law.terms) * len(keys_of(law.place, law.side))
        if (law.place, law.side) in seen:
            raise InputError(f"{where}: there are two; put their terms into one")
        seen.add((law.place, law.side))
        names = [term.name for term in law.terms]
        supports: dict[str, tuple[float, float]] = {}
        for term in law.terms:
            if not _NAME.match(term.name) or names.count(term.name) > 1:
                raise InputError(
                    f"{where}: term name {term.name!r} must be unique, of a-z, 0-9 and _"
                )
            if not math.isfinite(term.coefficient):
                raise InputError(
                    f"{where}: coefficient of {term.name} is {term.coefficient}; give a finite one"
                )
            if len(term.factors) > 2:
                raise InputError(
                    f"{where}: {term.name} has {len(term.factors)} factors; at most 2 are taken"
                )
            _known_states(law.place, [factor.state for factor in term.factors])
            for factor in term.factors:
                _check_factor(f"{where}: {term.name}", factor)
                span = (factor.low, factor.high)
                if supports.setdefault(factor.state, span) != span:
                    raise InputError(f"{where}: {factor.state} has two supports; give it one")
    if count > MOST_TERMS:
        raise InputError(f"the laws have {count} terms; at most {MOST_TERMS} are taken together")


def _check_factor(where: str, factor: Factor) -> None:
    if factor.kind not in KINDS:
        raise InputError(f"{where}: kind {factor.kind!r} is unknown; known are {', '.join(KINDS)}")
    numbers = (factor.lag_s, factor.low, factor.high, factor.centre, factor.scale)
    if not all(math.isfinite(number) for number in numbers):
        raise InputError(f"{where}: {factor.state} has a number that is not finite: {numbers}")
    if factor.lag_s < 0.0 or factor.low > factor.high or factor.scale <= 0.0:
        raise InputError(
            f"{where}: {factor.state} has lag {factor.lag_s:g} s, support {factor.low:g} to"
            f" {factor.high:g}, scale {factor.scale:g}; give lag >= 0, low <= high, scale > 0"
        )


def _known_states(place_name: str, names: Iterable[str]) -> None:
    allowed = place(place_name).states
    for name in names:
        if name not in allowed:
            raise InputError(
                f"state {name!r} is none that a law at {place_name} may depend on; those are"
                f" {', '.join(allowed)}"
            )


COLUMNS = 17
"""Of the kernel's table of terms: slot, coefficient, factors, then seven numbers for either one."""


def law_table(laws: Sequence[Law]) -> Array:
    """The kernel's table of the terms of these laws, shape (m, COLUMNS). Raises InputError."""
    check_laws(laws)
    rows = []
    for law in laws:
        for key in keys_of(law.place, law.side):
            for term in law.terms:
                row = np.zeros(COLUMNS)
                row[:3] = SLOTS[key], term.coefficient, len(term.factors)
                for n, f in enumerate(term.factors):
                    row[3 + 7 * n : 10 + 7 * n] = (
                        STATE_NAMES.index(f.state), f.lag_s, KINDS[f.kind], f.low, f.high,
                        f.centre, f.scale,
                    )  # fmt: skip
                rows.append(row)
    return np.array(rows) if rows else np.zeros((0, COLUMNS))


def unit_of_state(place_name: str, state: str) -> str:
    """Unit of a state of a place; readings have the channel's."""
    of_state = next(entry for entry in STATES if entry.name == state)
    unit = place(place_name).unit
    return {"reading": unit, "reading_rate": f"{unit}/s"}.get(state, of_state.unit)
