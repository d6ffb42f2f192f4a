"""Effects that nobody who works on the diagnosis reads before a bank of them is opened."""

from evaluation.plant.effect import Effect

EFFECTS: tuple[Effect, ...] = ()
