"""A heated plate as a unit of FMI: C·T' = power + extra − loss·(T − room)."""

from pythonfmu import Fmi2Causality, Fmi2Slave, Fmi2Variability, Real


class Heater(Fmi2Slave):
    """The script of the unit; pythonfmu packs it."""

    def __init__(self, **given):
        super().__init__(**given)
        self.power, self.extra = 0.0, 0.0
        self.capacity, self.loss, self.room = 30.0, 0.8, 22.0
        self.temperature = self.room
        for name in ("power", "extra"):
            self.register_variable(Real(name, causality=Fmi2Causality.input))
        for name in ("capacity", "loss", "room"):
            self.register_variable(
                Real(name, causality=Fmi2Causality.parameter, variability=Fmi2Variability.fixed)
            )
        self.register_variable(Real("temperature", causality=Fmi2Causality.output))

    def exit_initialization_mode(self):
        self.temperature = self.room

    def do_step(self, current_time, step_size):
        given = self.power + self.extra - self.loss * (self.temperature - self.room)
        self.temperature += step_size * given / self.capacity
        return self.temperature < 1e4
