"""What a plant remembers from one substep to the next, and what a substep scratches down.

All quantities are SI. Thermal quantities are per metre of wire unless they say joule.
"""

from __future__ import annotations

from typing import Annotated

CELLS = 5  # parts of a spring along its tube, with effect cooling_front
FORCED_SLOTS = 32  # places and sides, as in `places.SLOTS`
TURNS = 6  # turns of either kind that unified_kinetics remembers

# History of the samples, for channels that are read late: rows of t, T_x, T_y, u, F.
RING_ROWS = 512
RING_COLUMNS = 5
RING_TIME, RING_T_X, RING_T_Y, RING_U, RING_F = range(RING_COLUMNS)


class Leg:
    """Transformation in one direction. Turns, the latest first, are those of unified_kinetics."""

    progress: float  # where it stands; unified_kinetics: the furthest of the present leg
    turned_at: Annotated[list[float], TURNS]  # progress at which it turned
    left_there: Annotated[list[float], TURNS]  # what was left to transform then


class Memory:
    """What the kinetics of a spring, or of one cell, remember."""

    xi_S: float  # detwinned martensite fraction
    xi_T: float  # twinned martensite fraction
    heating: Leg  # progress a, Eq. (11); what is left is martensite
    cooling: Leg  # progress c, Eq. (12c); what is left is austenite
    stress_progress: float  # b of detwinning and of stress-induced martensite, Eqs (12), (13)
    direction: float  # -1 in a reverse, +1 in a forward transformation, 0 before any
    xi_turn: float  # fraction at which the leg began; unified_kinetics: at its furthest point


class Spring:
    """One spring with its water."""

    T_wire: float  # K
    T_water: float  # of the water in the tube, K
    T_wall: float  # of the tube, K
    T_wire_rate: float  # last rates, K/s
    T_water_rate: float
    memory: Memory  # of a spring without cells; with cells its fractions are their means
    transforms: float  # 1 while the fractions change
    fraction_rate: float  # of martensite in the last substep, 1/s
    cycles: float  # transformation cycles so far: half the sum of |Δξ|
    r_fraction: float  # R-phase
    r_progress: float  # its progress on cooling
    xi_S_end: float  # detwinned fraction of the cold ends
    tau: float  # shear stress that the kinetics last saw, Pa
    tension: float  # N
    deflection: float  # m
    current: float  # A
    square_current: float  # mean of its square over the substep, A2
    resistance: float  # Ohm
    duty: float  # asked of its pump, 0 to 1
    flow: float  # of water, m3/s
    filled: float  # share of the tube that holds water
    mean_filled: float  # its mean over the substep
    wetted: float  # share of the wire that flowing water touches
    pump_flow: float  # before leaks, its mean over the substep, m3/s
    pump_end_flow: float  # the same at the end of the substep
    pump_on: float  # time since the pump was switched on, or less than 0, off, s
    pump_starts: float  # times it was switched on
    rtd_lagged: float  # what a late RTD shows, K
    rtd_given: float  # what it was last given to follow, K
    elastic_energy: float  # J
    work_heat: float  # transformation work not yet in the heat balance, J/m
    heat_in: float  # books of energy, J: electrical heat taken in
    heat_to_water: float
    heat_to_air: float
    unequal_heat: float  # made by capacities and latent heats that differ with direction
    work_on: float  # mechanical work done on the spring
    omitted_work: float  # transformation work that the heat balance leaves out
    heat_forced: float  # put in by a forcing
    forced_deflection: float  # m
    forced_current: float  # part of `current` that a forcing added, A
    # Cells from the inlet on: distance from the means, K; last rates of the wire, but for what the
    # front moves, K/s.
    wire_off: Annotated[list[float], CELLS]
    water_off: Annotated[list[float], CELLS]
    cell_rate: Annotated[list[float], CELLS]
    cells: Annotated[list[Memory], CELLS]


class Sensed:
    """What the sensors give at the last sample, without noise, in the order of `Readings`."""

    i_x: float  # A
    i_y: float
    v_x: float  # V
    v_y: float
    rtd_x: float  # K
    rtd_y: float
    rtd_inlet: float
    rtd_air: float
    displacement: float  # m
    force: float  # N


class Shared:
    """What the springs share."""

    time: float  # s
    displacement: float  # m, positive when X contracts
    speed: float  # its rate, m/s
    tension: float  # of the tendon, N
    tension_rate: float  # N/s
    T_inlet: float  # K
    T_air: float
    given_inlet: float  # as given from outside, K
    given_air: float
    reservoir_rise: float  # K
    air_rise: float
    creep: float  # state of the force sensor, N
    play: float  # of the encoder, m
    slip: float  # lost by the encoder, m
    slip_from: float  # displacement at the last sample, m
    samples: float
    rounds: float  # evaluations of the kinetics so far, all parts together
    forced_inlet: float  # K
    forced_air: float
    forced_cell: float  # what a force between the springs adds to the force sensor's, N
    added: Sensed  # to what each sensor is given, and its rate
    added_rate: Sensed
    sensed: Sensed
    raw: Sensed  # under a forcing: what the sensors gave before it, and the rates of that
    raw_rate: Sensed


class State:
    """The whole state of a plant."""

    x: Spring
    y: Spring
    shared: Shared


class Curve:
    """unified_kinetics: an outer curve at places that rest within a substep, -1 until needed."""

    begin: float  # at the furthest progress of the leg
    turn: float  # at the latest turn


class PartWork:
    """One part of a spring (the whole, or a cell) in a substep."""

    T_wire: float  # temperature at the end of the substep as far as known, K
    T_by_F: float  # how it follows the tension, K/N
    xi_S: float  # fractions at the last evaluation
    xi_T: float
    xi_by_T: float  # their slopes: ξ and ξ_S with temperature and tension
    xi_by_F: float
    xi_S_by_T: float
    xi_S_by_F: float
    f_a: float  # f(a), f(b), f(c) at the start of the substep, -1 until needed
    f_b: float
    f_c: float
    above_M_S: float  # 1 when the substep starts above M_S
    crossing: float  # share of the substep after which M_S is passed, 0 when it is not
    xi_back: float  # fraction at which a reverse leg began, or would begin now
    xi_forth: float
    heating: Curve
    cooling: Curve
    wire_before: float  # of a cell: `wire_off` and `water_off` before the front moves
    water_before: float
    unit_water: float  # of a cell: its water where all lose alike
    own_rise: float  # of a cell: what its latent heat makes of the wire, K


class SpringWork:
    """One spring in a substep: heat balance, mechanics, and its parts."""

    fed: float  # 1 when its temperature is fed
    T_fed: float  # K, at the end of the substep
    T_star: float  # end temperature if no fraction changed, K
    lam_heating: float  # K per unit of fraction, reverse transformation
    lam_cooling: float
    cell_lam_heating: float  # the same of a cell's own transformation
    cell_lam_cooling: float
    latent_factor: float
    T_shift: float  # drift of the transformation temperatures, K
    heating_start: float  # unified_kinetics: where both transformations begin at the tension, K
    cooling_start: float
    detwinned: float  # unified_kinetics: share of martensite that the tension turns, and its slope
    detwinned_by_F: float
    capacity: float  # of the wire, J/(m K)
    g_water: float  # conductances: wire to water, W/(m K)
    g_dry: float  # wire to air
    g_flow: float  # carried by the flow
    g_loss: float  # tube to air
    g_wall: float  # water to tube
    water_right: float  # middle of the water = (water_right + g_water middle of the wire) per_water
    per_water: float  # 0 without a water node
    power: float  # W/m
    forced_heat: float  # into the wire and into the water, W/m
    forced_water: float
    forced_film: float  # factor on the film
    forced_shift: float  # of the transformation temperatures, K
    leaves_warmer: float  # how much warmer than its mean the water leaves, K
    T_end: float  # mean temperature of the wire at the end, K
    xi_S: float  # mean fractions
    xi_T: float
    deflection: float  # m
    deflection_by_F: float  # m/N
    compliance: float  # elastic, m/N
    miss: float  # step of temperature still to be taken, K
    F_phase: float  # tension that the kinetics see, N
    front_share: float  # s of `temperatures`: share of the front, 1 without one
    rounds: float  # evaluations of the kinetics in this substep
    whole: PartWork
    cells: Annotated[list[PartWork], CELLS]


class SpringFeed:
    """Measured series of one spring that replace inner signals, over one sample."""

    current: float  # A
    T_start: float  # K, at the start and the end of the sample
    T_end: float


class Feeds:
    """Measured series that replace inner signals. Flags are 1 when a signal is fed."""

    feeds_current: float
    feeds_temperature: float
    feeds_force: float
    feeds_displacement: float
    feeds_surroundings: float
    x: SpringFeed
    y: SpringFeed
    force_start: float  # N
    force_end: float
    displacement_start: float  # m
    displacement_end: float
    T_inlet: float  # K
    T_air: float


class Driven:
    """What the board applies during a sample, in the order of a row of `Inputs.rows`."""

    i_x: float  # A
    i_y: float
    duty_x: float  # 0 to 1
    duty_y: float
    drain_x: float  # 0 or 1
    drain_y: float
    stage: float  # m


class Work:
    """Everything that a substep needs and the next one does not remember."""

    x: SpringWork
    y: SpringWork
    feeds: Feeds
    drive: Driven
    forces: float  # 1 when something is forced; nothing below is read otherwise
    # Force between the springs at rest, and what it gains with the velocity: N, N s/m. Then the
    # same of what the force sensor reads beyond their mean.
    between: float
    between_slope: float
    cell: float
    cell_slope: float
    held: Annotated[list[float], FORCED_SLOTS]  # forcing of the sample
    forced: Annotated[list[float], FORCED_SLOTS]  # of the substep, with what laws add
