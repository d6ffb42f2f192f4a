"""Water: tabulated properties, the paper's printed polynomials, and the kernel's film table."""

from __future__ import annotations

import csv
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
TABLE = Path(__file__).parent / "data" / "water.csv"
GRAVITY = 9.81


@dataclass(frozen=True)
class Water:
    """Properties of water at temperatures `T_K`, SI: arrays of one shape.

    rho density, cp heat capacity, k conductivity, mu dynamic viscosity, beta volumetric expansion.
    """

    T_K: Array
    rho: Array
    cp: Array
    k: Array
    mu: Array
    beta: Array

    @property
    def nu(self) -> Array:
        return self.mu / self.rho

    @property
    def prandtl(self) -> Array:
        return self.mu * self.cp / self.k

    @property
    def diffusivity(self) -> Array:
        return self.k / (self.rho * self.cp)


@cache
def real_water() -> Water:
    """Water at 1 atm (IAPWS-95), 280 to 372 K in steps of 1 K; see `make_water_table`."""
    with TABLE.open(encoding="utf-8", newline="") as file:
        reader = csv.reader(file)
        next(reader)
        columns = np.array([[float(cell) for cell in row] for row in reader]).T
    return Water(*(np.ascontiguousarray(column) for column in columns))


@cache
def printed_water() -> Water:
    """The paper's printed polynomials of section 4.1 at the same nodes.

    They are two-digit roundings, wrong by up to 148 % (Prandtl number). β_w is printed in 1e-6/K.
    C_w follows from Pr = μ C_w/k_w, Eq. (22).
    """
    T = real_water().T_K
    mu = 4.8e-8 * T**2 - 3.9e-5 * T + 0.0081
    k = -2.3e-6 * T**2 + 0.0021 * T + 0.17
    prandtl = 0.00039 * T**2 - 0.3 * T + 63.0
    rho = -0.2 * T + 1.1e3
    beta = (-0.049 * T**2 + 39.0 * T - 7e3) * 1e-6
    return Water(T, rho, prandtl * k / mu, k, mu, beta)


def interpolated(water: Water, T_K: float) -> Water:
    """The properties at one temperature, by a cubic through the four nodes around it.

    Raises ValueError outside of the table.
    """
    nodes = water.T_K
    if not nodes[0] <= T_K <= nodes[-1]:
        raise ValueError(f"water at {T_K} K: the table covers {nodes[0]} to {nodes[-1]} K")
    first = int(np.clip(np.searchsorted(nodes, T_K, side="right") - 2, 0, nodes.size - 4))
    near = nodes[first : first + 4]
    others = [np.delete(near, place) for place in range(4)]
    weights = np.array(
        [np.prod((T_K - rest) / (node - rest)) for node, rest in zip(near, others, strict=True)]
    )
    columns = (water.rho, water.cp, water.k, water.mu, water.beta)
    return Water(
        np.array([T_K]),
        *(np.array([weights @ column[first : first + 4]]) for column in columns),
    )


@cache
def film_table(variant: str) -> Array:
    """Film coefficients of the wire in the tube, all that depends on the film temperature alone.

    Shape (n, 4), nodes every 1 K from 280 K. With D the hydraulic diameter, ΔT = |T − T_w| and u
    the water's velocity, the columns c give
    free convection, Eqs (19)-(21) with Churchill-Chu (20): h = c0/D (0.60 + c1 ΔT^(1/6) √D)²;
    forced convection, Eqs (24), (25): h = (c2 + c3 √(u D))/D.
    Variant "printed" uses the printed polynomials and 0.56, "extended" real water and 0.559.
    """
    water, constant = (printed_water(), 0.56) if variant == "printed" else (real_water(), 0.559)
    pr = water.prandtl
    rayleigh = GRAVITY * water.beta / (water.nu * water.diffusivity)
    shape = (1.0 + (constant / pr) ** (9.0 / 16.0)) ** (16.0 / 9.0)
    forced = water.k * pr**0.29
    table = np.empty((pr.size, 4))
    table[:, 0] = water.k
    table[:, 1] = 0.387 * (rayleigh / shape) ** (1.0 / 6.0)
    table[:, 2] = 0.255 * forced
    table[:, 3] = 0.699 * forced / np.sqrt(water.nu)
    table.setflags(write=False)
    return table
