"""Software of a shape-memory-alloy actuator bench: daemon, clients, run logs, experiments, diagnosis."""

__version__ = "0.1.0"
