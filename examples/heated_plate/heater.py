"""A heated plate as a unit of FMI 2.0: what it stores and what it loses to the room."""

from pythonfmu import Fmi2Causality, Fmi2Slave, Fmi2Variability, Real


class Heater(Fmi2Slave):
    def __init__(self, **given):
        super().__init__(**given)
        self.power = self.extra = 0.0
        self.capacity, self.loss, self.temperature = 30.0, 0.8, 22.0
        for name in ("power", "extra"):
            self.register_variable(Real(name, causality=Fmi2Causality.input))
        for name in ("capacity", "loss"):
            self.register_variable(
                Real(name, causality=Fmi2Causality.parameter, variability=Fmi2Variability.fixed)
            )
        self.register_variable(Real("temperature", causality=Fmi2Causality.output))

    def do_step(self, current_time, step_size):
        given = self.power + self.extra - self.loss * (self.temperature - 22.0)
        self.temperature += step_size * given / self.capacity
        return True
