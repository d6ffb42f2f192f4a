"""What users would write for one pendulum: a function, an own class, a model, a unit, maps."""
