"""The plant's equations, stepped: compiled functions over records with named fields.

Read `state` and `model` first, for what there is; then `paper_kinetics`, `film`, `heat` and
`mechanics` beside the paper; then `temperatures`, `equilibrium` and `step`, which solve them.
Equation numbers are those of Cheng et al., J. Intell. Mater. Syst. Struct. 28(16), 2017. All
quantities are SI. Only what this package exports is called from outside.
"""

from sim_device.plant.kernel.compiled import text_digest
from sim_device.plant.kernel.curves import lay_curves
from sim_device.plant.kernel.forcing import FIRST_READING, MEMORY_COLUMNS
from sim_device.plant.kernel.layout import copied, fill, filled, numbers, place_of, zeros
from sim_device.plant.kernel.many import advance_many
from sim_device.plant.kernel.model import (
    ANTAGONISTIC,
    BLOCKED,
    CURVE_SIZE,
    PROGRESS_HIGH,
    PROGRESS_LOW,
    STRETCH,
    Constants,
    Effects,
    Model,
)
from sim_device.plant.kernel.probes import (
    compliance_of,
    film_conductance_of,
    lag_samples,
    outer_curve,
)
from sim_device.plant.kernel.replay import replay, replay_drivers
from sim_device.plant.kernel.rest import Mounting, rest
from sim_device.plant.kernel.state import (
    CELLS,
    FORCED_SLOTS,
    RING_COLUMNS,
    RING_ROWS,
    TURNS,
    State,
    Work,
)
from sim_device.plant.kernel.step import NOT_CONVERGED, NOT_FINITE, OK, advance

__all__ = [
    "ANTAGONISTIC",
    "BLOCKED",
    "CELLS",
    "CURVE_SIZE",
    "FIRST_READING",
    "FORCED_SLOTS",
    "MEMORY_COLUMNS",
    "NOT_CONVERGED",
    "NOT_FINITE",
    "OK",
    "PROGRESS_HIGH",
    "PROGRESS_LOW",
    "RING_COLUMNS",
    "RING_ROWS",
    "STRETCH",
    "TURNS",
    "Constants",
    "Effects",
    "Model",
    "Mounting",
    "State",
    "Work",
    "advance",
    "advance_many",
    "compliance_of",
    "copied",
    "fill",
    "filled",
    "film_conductance_of",
    "lag_samples",
    "lay_curves",
    "numbers",
    "outer_curve",
    "place_of",
    "replay",
    "replay_drivers",
    "rest",
    "text_digest",
    "zeros",
]
