"""Where each quantity of the plant's state lives in its arrays.

`cells[spring, cell, …]` along the tube, `side[spring, …]` per spring, `pair[…]` for the whole.
"""

CELLS = 6
PLAYS = 6

(
    T,
    W,
    TURNED,
    FRACTION,
    HEATED_FROM,
    COOLED_FROM,
    HEATING,
    BUBBLE,
    WET,
    R_PHASE,
    PRECIPITATED,
    PLAY,
) = range(12)
CELL_WIDTH = PLAY + PLAYS

(
    LAG_A,
    LAG_B,
    LAG_C,
    PUMP,
    SPIN,
    SPIN_RATE,
    FILL,
    RTD_A,
    RTD_B,
    STEM,
    CONTACT,
    SHUNT,
    WORK_DONE,
    ASLEEP,
    HOT,
    PUMP_ON,
    POCKET,
    FLOW,
    AMPERE,
    OHM,
    RATE,
    QUIET,
    COMPLIANT,
    FREE_STRAIN,
    GROWN,
    DRAINED,
    RAMPED,
    CLIP,
    SWIRL,
    RATCHETED,
    GIVEN_WAY,
    SETTLED,
    OPENED,
    CRIMP,
    SOAKED,
    BOUND,
    RTD_BEFORE,
    AMPERE_BEFORE,
    HOSE,
    LONG_ON,
    HELD_DOWN,
    CORRODED,
    MISTED,
    LIMED,
    AIR_DRAWN,
    TIRED,
    INNER_STRESS,
    LEAD_WARM,
    AVERAGED,
    SHRUNK,
    SIDE_WIDTH,
) = range(51)

(
    TIME,
    X,
    FORCE_X,
    FORCE_Y,
    FRICTION,
    SPEED,
    ENCODER,
    SLIPPED,
    CREEP_FAST,
    CREEP_SLOW,
    FRAME,
    RESERVOIR,
    GLANCE,
    COUPLED,
    GUIDE,
    BOARD,
    FAN_WARM,
    FAN,
    LOST,
    BRACKET,
    SKIN,
    CORE,
    SHEARED,
    SINK_WARM,
    INDEXED,
    SPONGE,
    PAIR_WIDTH,
) = range(27)

RING_DUTY_X, RING_DUTY_Y, RING_X, RING_FORCE, RINGS = range(5)
RING_LENGTH = 256

INPUTS = ("i_x_A", "i_y_A", "duty_x", "duty_y", "inlet_degC", "ambient_degC", "luck_x", "luck_y")
I_X, I_Y, DUTY_X, DUTY_Y, INLET, AMBIENT, LUCK_X, LUCK_Y = range(8)

READINGS = (
    "i_meas_x_A",
    "i_meas_y_A",
    "v_x_V",
    "v_y_V",
    "rtd_x_degC",
    "rtd_y_degC",
    "rtd_inlet_degC",
    "rtd_ambient_degC",
    "displacement_mm",
    "force_N",
    "supply_V",
)
TRUTHS = (
    "T_x_degC",
    "T_y_degC",
    "water_x_degC",
    "water_y_degC",
    "xi_x",
    "xi_y",
    "turned_x",
    "turned_y",
    "true_mm",
    "true_force_N",
    "flow_x",
    "flow_y",
)
COLUMNS = READINGS + TRUTHS
