import math

import numpy as np

from smad.diagnosis.plant import Channel, Effect, EffectParameter, Parameter, Signal, Traits


class Pendulum:
    name, version = "pendulum", "1"
    traits = Traits(shortest_s=1.0)
    inputs = (Signal("torque_N_m", "N m", -1.5, 1.5),)
    channels = (
        Channel(name="angle_rad", unit="rad", quantum=1e-4, low=-7.0, high=7.0, noise=1e-3),
    )
    parameters = (
        Parameter(name="mass_kg", unit="kg", nominal=1.0, low=0.5, high=2.0, prior_sd=0.25),
        Parameter(name="damping", unit="", nominal=0.05, low=0.0, high=0.3, prior_sd=0.05),
    )
    effects = (
        Effect(
            name="friction",
            title="dry friction",
            parameters=(EffectParameter(name="size", unit="N m", typical=0.05, low=0.0, high=0.5),),
            signals=("angle_rad",),
            places=("input_torque_N_m",),
        ),
    )

    def simulate(self, point, run, *, fast=False):
        whole = run if run.whole is None else run.whole
        theta = {p.name: p.nominal for p in self.parameters} | dict(point.theta)
        friction = point.effects.get("friction", {}).get("size", 0.0)
        first = slice(0, 12)
        start = np.polynomial.Polynomial.fit(
            whole.t_s[first] - whole.t_s[0], whole.outputs["angle_rad"][first], 2
        ).convert()
        angle, rate, angles = start(0.0), start.deriv()(0.0), []
        inertia = theta["mass_kg"] * 0.5**2
        torques = np.repeat(run.inputs["torque_N_m"], run.pieces.astype(int))
        for torque in torques.tolist():
            angles.append(angle)
            push = torque - theta["damping"] * rate
            push -= 9.81 * 0.5 * theta["mass_kg"] * math.sin(angle)
            rate += 0.01 * push / inertia
            stopped = 0.01 * friction / inertia
            rate -= min(max(rate, -stopped), stopped)
            angle += 0.01 * rate
        ends = np.cumsum(run.pieces).astype(int)
        total = np.cumsum(np.r_[0.0, angles])
        return {"angle_rad": np.diff(total[np.r_[0, ends]]) / run.pieces}

    def regimes(self, run, side):
        return {"rest": np.zeros(len(run.t_s), dtype=bool)}


PLANT = Pendulum()
