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

from dataclasses import dataclass

import numba
import numpy as np

from smad.diagnosis.plant import Channel, Effect, EffectParameter, Parameter, Signal, Traits

STEP_S = 1e-3
LAP = 6240
"""Samples in which the programme comes back to where it began."""
_PITCH_M = 50_000 * 5e-8
"""Travel of a turn of the screw: counts of the encoder, and what a count is."""
_MIDDLE_M = 0.12
"""Of the axis, from where each lap begins."""


def _shape(name: str, unit: str, typical: float, low: float, high: float) -> EffectParameter:
    return EffectParameter(
        name=name, unit=unit, typical=typical, low=low, high=high, strength=False
    )


def _effect(name: str, title: str, unit: str, high: float, *shapes, low: float = 0.0) -> Effect:
    size = EffectParameter(name="size", unit=unit, typical=high / 4, low=low, high=high)
    return Effect(name=name, title=title, parameters=(size, *shapes), signals=("position_rate",))


_EFFECTS = (
    _effect("coulomb_friction", "friction of constant size", "N", 60.0),
    _effect("stribeck", "friction that fades with speed", "N", 60.0,
            _shape("fades_m_s", "m/s", 0.01, 0.001, 0.1)),
    _effect("one_way_drag", "more drag forwards than backwards", "N s/m", 200.0, low=-200.0),
    _effect("quadratic_drag", "drag with the square of the speed", "N s²/m²", 4000.0),
    _effect("drag_along", "drag that grows along the axis", "N s/m²", 2000.0, low=-2000.0),
    _effect("axis_spring", "a force that grows along the axis", "N/m", 200.0, low=-200.0),
    _effect("screw_ripple", "a force that goes with the turn of the screw", "N", 40.0,
            _shape("phase", "rad", 0.0, -np.pi, np.pi)),
    _effect("drive_bend", "a drive gain that changes with the force", "1/N²", 2e-5, low=-2e-5),
    _effect("drive_dead_zone", "no force below a command", "N", 40.0),
    _effect("drive_lag", "the force follows late", "s", 0.05),
    _effect("encoder_play", "play between screw and encoder", "m", 1e-3),
    _effect("encoder_lag", "the motion is shown late", "s", 0.05),
)  # fmt: skip


@dataclass(frozen=True)
class Emps:
    """Motor force and rate of the position on the load's side, one sample a millisecond."""

    name: str = "positioning drive"
    version: str = "1"
    traits = Traits(shortest_s=6.0)  # a lap, there and back
    inputs = (Signal("force_N", "N", -350.0, 350.0),)
    channels = (
        Channel(name="position_rate", unit="m/s", quantum=2.5e-5, low=-0.5, high=0.5, noise=1e-4),
    )
    parameters = (
        Parameter(name="mass_kg", unit="kg", nominal=100.0, low=50.0, high=200.0, prior_sd=20.0),
        Parameter(
            name="drag_N_s_m", unit="N s/m", nominal=300.0, low=10.0, high=1000.0, prior_sd=200.0
        ),
        Parameter(name="offset_N", unit="N", nominal=0.0, low=-20.0, high=20.0, prior_sd=5.0),
    )
    effects = _EFFECTS

    def simulate(self, point, run, *, fast=False):
        theta = np.array([point.theta.get(p.name, p.nominal) for p in self.parameters])
        values = [
            point.effects.get(e.name, {}).get(p.name, 0.0 if p.strength else p.typical)
            for e in self.effects
            for p in e.parameters
        ]
        whole = run if run.whole is None else run.whole
        # A run begins in motion, with the rate that it shows first.
        start = float(whole.outputs["position_rate"][0]) if whole.outputs else 0.0
        # A row may be the mean of several samples: each is replayed, and their mean shown.
        ends = np.rint((run.t_s - whole.t_s[0]) / STEP_S).astype(np.intp) + 1
        pieces = np.diff(np.r_[0, ends])
        course = _replay(run.inputs["force_N"], pieces, start, theta, np.array(values))
        return {"position_rate": course}

    def regimes(self, run, side):
        rate = run.outputs["position_rate"]
        return {
            "rest": np.zeros(len(rate), dtype=bool),
            "forwards": rate > 0.0,
            "backwards": rate < 0.0,
            "slow": np.abs(rate) < 0.05,
        }


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
def _replay(force, pieces, start, theta, values):
    coulomb, stribeck, fades = values[:3]
    drive_lag, play, encoder_lag = values[11:]
    course = np.empty(len(force))
    step = STEP_S / theta[0]
    x = followed = 0.0
    w = shown = start
    pushing = force[0]
    for k in range(len(force)):
        total = 0.0
        for i in range(pieces[k]):
            if k + i > 0:
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
            total += shown
        course[k] = total / pieces[k]
    return course
