"""Effects that nobody who works on the diagnosis reads before a bank of them is opened.

Where a forcing at another place would leave less than one floor of ten, that place is right, too.
The load cell is beside X, so that a force between the springs has one place.
"""

from evaluation.plant.effect import Effect

EFFECTS: tuple[Effect, ...] = ()

SIGNED: frozenset[str] = frozenset()
"""Those whose magnitude may be negative."""
