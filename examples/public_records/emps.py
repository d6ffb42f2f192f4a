"""A positioning drive as a mass with drag that a motor pushes, and twelve things it may do beside.

Published (Janot, Gautier and Brunot, Workshop on Nonlinear System Identification Benchmarks 2019,
equations 1 and 12): M·x″ + F·x′ + Fc·sign(x′) + offset = force, and F is smaller forwards.
The model given here has no Fc, and one F.

The drive was in a closed loop. The input here is the force that its motor was told to give, so that
no model of the controller is needed.
The output is not the position that was recorded, but its central difference. A position adds up all
that a model gets wrong of the force: after some seconds the model moves another way than the drive.
What a speed is off by is forgotten within mass/drag, half a second.
The output's name ends in "_rate", since a law may go with the sign of such a state only.
"""

from __future__ import annotations

import numba
import numpy as np

from smad.simulators import Missing, simulator

STEP_S = 1e-3
LAP = 6240
"""Samples in which the programme comes back to where it began."""
_PITCH_M = 50_000 * 5e-8
"""Travel of a turn of the screw: counts of the encoder, and what a count is."""
_MIDDLE_M = 0.12
"""Of the axis, from where each lap begins."""


def _size(title: str, unit: str, high: float, *, low: float = 0.0, **shapes) -> Missing:
    return Missing(typical=high / 4, low=low, high=high, title=title, unit=unit, shapes=shapes)


_EFFECTS = {
    "coulomb_friction": _size("friction of constant size", "N", 60.0),
    "stribeck": _size("friction that fades with speed", "N", 60.0, fades_m_s=(0.01, 0.001, 0.1)),
    "one_way_drag": _size("more drag forwards than backwards", "N s/m", 200.0, low=-200.0),
    "quadratic_drag": _size("drag with the square of the speed", "N s²/m²", 4000.0),
    "drag_along": _size("drag that grows along the axis", "N s/m²", 2000.0, low=-2000.0),
    "axis_spring": _size("a force that grows along the axis", "N/m", 200.0, low=-200.0),
    "screw_ripple": _size(
        "a force that goes with the turn of the screw", "N", 40.0, phase_rad=(0.0, -np.pi, np.pi)
    ),
    "drive_bend": _size("a drive gain that changes with the force", "1/N²", 2e-5, low=-2e-5),
    "drive_dead_zone": _size("no force below a command", "N", 40.0),
    "drive_lag": _size("the force follows late", "s", 0.05),
    "encoder_play": _size("play between screw and encoder", "m", 1e-3),
    "encoder_lag": _size("the motion is shown late", "s", 0.05),
}


def _drive(t, inputs, values, start):
    # A run begins in motion, with the rate that it shows first.
    theta = np.array([values[n] for n in _PARAMETERS])
    rest = np.array([values[n] for n in values if n not in _PARAMETERS])
    return {"position_rate": _replay(inputs["force_N"], start["position_rate"], theta, rest)}


_PARAMETERS = {
    "mass_kg": (100.0, 50.0, 200.0, 20.0),
    "drag_N_s_m": (300.0, 10.0, 1000.0, 200.0),
    "offset_N": (0.0, -20.0, 20.0, 5.0),
}
EMPS = simulator(
    _drive, name="positioning drive", parameters=_PARAMETERS, effects=_EFFECTS,
    units={"position_rate": "m/s"}, ranges={"force_N": (-350.0, 350.0)},
    shortest_s=6.0,  # a lap, there and back
)  # fmt: skip


@numba.njit(nogil=True)
def _push(x, w, force, theta, values):
    _, drag, offset = theta
    _, _, _, one_way, quadratic, along, spring, ripple, phase, bend, dead_zone = values[:11]
    push = force - min(max(force, -dead_zone), dead_zone)
    push *= 1.0 - bend * push * push
    push -= offset + spring * (x - _MIDDLE_M)
    if ripple != 0.0:
        push -= ripple * np.sin(2.0 * np.pi * x / _PITCH_M + phase)
    loss = drag + quadratic * abs(w) + along * (x - _MIDDLE_M)
    loss += one_way * (0.5 if w > 0.0 else -0.5)
    return push - loss * w


@numba.njit(nogil=True)
def _replay(force, start, theta, values):
    coulomb, stribeck, fades = values[:3]
    drive_lag, play, encoder_lag = values[11:]
    course = np.empty(len(force))
    step = STEP_S / theta[0]
    x = followed = 0.0
    w = shown = start
    pushing = force[0]
    for k in range(len(force)):
        if k > 0:
            pushing += (force[k] - pushing) * (
                1.0 if drive_lag == 0.0 else 1.0 - np.exp(-STEP_S / drive_lag)
            )
            w += step * _push(x, w, pushing, theta, values)
            # Friction takes speed off, and holds what it can stop.
            held = step * (coulomb + stribeck * np.exp(-((w / fades) ** 2)))
            w -= min(max(w, -held), held)
            # A model that runs away must lose, and must not stop the fit.
            w = min(max(w, -10.0), 10.0)
            x += STEP_S * w
            rate = w
            if play != 0.0:
                before = followed
                followed += x - followed - min(max(x - followed, -play), play)
                rate = (followed - before) / STEP_S
            shown += (rate - shown) * (
                1.0 if encoder_lag == 0.0 else 1.0 - np.exp(-STEP_S / encoder_lag)
            )
        course[k] = shown
    return course
