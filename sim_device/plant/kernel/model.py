"""What does not change during a run: constants of the plant, and terms of the effects."""

from __future__ import annotations

from typing import Annotated

# unified_kinetics tables its outer curves as value and slope (per cell) at even steps of the
# progress, which it follows this far beyond 0 and 1.
PROGRESS_LOW, PROGRESS_HIGH = -1.0, 2.0
CURVE_CELLS_PER_UNIT = 128
CURVE_CELLS = 3 * CURVE_CELLS_PER_UNIT
CURVE_SIZE = 2 * (CURVE_CELLS + 1)

ANTAGONISTIC, STRETCH, BLOCKED = 0.0, 1.0, 2.0


class Constants:
    """Made from a parameter set by `constants.kernel_constants`; symbols are the paper's."""

    C1: float  # τ = C1 F, Eq. (3), Pa/N
    k_M: float  # spring constants C2 G/C1 of martensite and austenite, N/m
    k_A: float
    delta_L: float  # deflection of complete detwinning, m
    delta_0: float  # deflection of a mounted spring at rest, m
    F0: float  # tension of the mounted pair at rest, N
    A_S: float  # K
    per_A_range: float  # 1/(A_F - A_S)
    per_C_A: float  # 1/C_A, K/Pa
    M_S: float
    per_M_range: float  # 1/(M_S - M_F)
    C_M: float  # Pa/K
    tau_start: float  # τ_s, Pa
    per_tau_range: float  # 1/(τ_f - τ_s)
    capacity_heating: float  # m' C_h, J/(m K)
    capacity_cooling: float
    latent_heating: float  # m' L_h, J/m
    latent_cooling: float
    resistance_per_m: float  # Ohm/m
    length: float  # of wire, m
    per_length: float
    water_capacity: float  # of the water in the tube, J/(m K)
    warming_share: float  # φ, share of it that warms
    tube_loss: float  # UA', W/(m K)
    flow_conductance: float  # ρ c/L, W/(m K) per m3/s
    flow_max: float  # m3/s
    per_annulus: float  # 1/section of the water, 1/m2
    fill_rate: float  # 1/volume of the tube, 1/m3
    drain_rate: float  # 1/s
    drain_film: float  # share of the water that a purge leaves
    D_h: float  # hydraulic diameter, Eq. (19), m
    per_D_h: float
    sqrt_D_h: float
    film_perimeter: float  # perimeter of the wire times the film scale, m
    air_conductance: float  # π k_a
    air_convection: float  # Churchill-Chu factor of air, Eq. (20), 1/K^(1/6)
    gap_conductance: float  # from the wire through a dry tube to the air, W/(m K)
    table_T0: float  # first temperature of the film table, K
    T_ref: float  # reference of stored heat, K
    I_max: float  # A
    work_share: float  # χ, share of the transformation work in the heat balance
    fixture: float  # ANTAGONISTIC, STRETCH or BLOCKED
    warms: float  # 1 when the water in the tube is a node
    wet: float  # 1 with cooling module, 0 bare wire in air


class Curves:
    """unified_kinetics: its two outer curves, see `curves.lay_curves`."""

    heating: Annotated[list[float], CURVE_SIZE]
    cooling: Annotated[list[float], CURVE_SIZE]


class Effects:
    """Terms of the candidate effects; all zero is the plant without any.

    `EffectParameter.term` in the registry names these fields. `effect_terms` makes the last ones.
    """

    # Driver and springs as resistors.
    driver_gain: float
    driver_lag: float
    driver_deficit: float
    driver_sharpness: float
    resistivity_T: float
    resistivity_xi: float
    contact_resistance: float
    current_offset: float
    # Sensors.
    rtd_lag: float
    rtd_offset: float
    rtd_stem: float
    backlash: float
    slip_share: float
    force_offset: float
    force_gain: float
    creep_share: float
    creep_time: float
    delay_T: float
    delay_u: float
    delay_F: float
    skew_ppm: float
    # Heat.
    air_drift: float
    air_bend: float
    air_seen: float
    cold_ends: float
    end_loss: float
    spread: float
    front: float
    rtd_place: float
    film_exponent: float
    loss_exponent: float
    film_reference: float
    loss_reference: float
    crosstalk: float
    wall_ratio: float
    wall_conductance: float
    # Water.
    inverse_warming_share: float
    drainage: float
    drainage_time: float
    air_pockets: float
    pump_dead_time: float
    pump_spinup: float
    flow_shortfall: float
    uneven_flow: float
    inverse_reservoir: float
    valve_leak: float
    # Phases.
    minor_kappa: float
    minor_memory: float
    fatigue_shift: float
    fatigue_shrink: float
    r_strain: float
    r_resistivity: float
    r_above: float
    r_width: float
    unified: float
    tails: float
    latent_slope: float
    # Mechanics.
    coulomb: float
    proportional_friction: float
    stribeck: float
    stribeck_speed: float
    drag: float
    tendon_slack: float
    slack_force: float
    tendon_compliance: float
    tube_stiffness: float
    elongation: float
    # Made from others.
    resists: float  # 1: friction, drag, tube stiffness or a tendon that gives
    adds_strain: float  # 1: anything that adds to Eq. (9) of a spring
    late: float  # 1: any delayed channel
    driver_knee: float  # (I_max/I_s)^n of driver_saturation
    pair_stiffness: float  # of both tubes, N/m
    pair_drag: float  # mean of both tubes, N s/m
    reads_x: float  # share of X's tension in what the force sensor reads, beyond one half
    curves: Curves


class Model:
    """A plant that can be stepped. Each spring, driver, lead, RTD and tube has its side's terms.

    What the sides share is read from `x`.
    """

    p: Constants
    x: Effects
    y: Effects
