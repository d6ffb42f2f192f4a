"""The pendulum as a unit of FMI: an angle, its rate, and an input that a term may be added to."""

import math

from pythonfmu import Fmi2Causality, Fmi2Slave, Fmi2Variability, Real


class Pendulum(Fmi2Slave):
    """The script of the unit; pythonfmu packs it."""

    def __init__(self, **given):
        super().__init__(**given)
        self.torque = self.extra = 0.0
        self.mass, self.damping = 1.0, 0.05
        self.angle = self.rate = self.angle_0 = self.rate_0 = 0.0
        for name in ("torque", "extra"):
            self.register_variable(Real(name, causality=Fmi2Causality.input))
        for name in ("mass", "damping", "angle_0", "rate_0"):
            self.register_variable(
                Real(name, causality=Fmi2Causality.parameter, variability=Fmi2Variability.fixed)
            )
        for name in ("angle", "rate"):
            self.register_variable(Real(name, causality=Fmi2Causality.output))

    def exit_initialization_mode(self):
        self.angle, self.rate = self.angle_0, self.rate_0

    def do_step(self, current_time, step_size):
        push = self.torque + self.extra - self.damping * self.rate
        push -= 9.81 * 0.5 * self.mass * math.sin(self.angle)
        self.rate += step_size * push / (self.mass * 0.5**2)
        self.angle += step_size * self.rate
        return True
