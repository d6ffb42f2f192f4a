"""Effects of no list whose sealed bank was opened last: they have joined development banks.

Where a forcing at another place would leave less than one floor of ten, that place is right, too.
The load cell is beside X, so that a force between the springs has one place.
"""

from evaluation.plant.effect import FLOW, Effect

EFFECTS: tuple[Effect, ...] = (
    Effect("burst_firing", "dev", "electrical", "1", 0.00926, 0.5, "driven_current",
           "current time",
           "a driver fires in bursts: I + e(b − I), b 4 A for a share of I/4 A of every 3 s, from "
           "c on, else 0"),
    Effect("worn_setpoint_track", "dev", "electrical", "1", 0.0141, 0.9, "driven_current",
           "current",
           "the track of a driver's set value is worn at one place: I[1 − e exp(−((I − 1 A − "
           "2c A)/0.4 A)²)]"),
    Effect("migrating_solder", "dev", "electrical", "ohm", 0.0118, 0.3,
           "resistance reading_voltage",
           "current time",
           "current carries solder out of the joint at the inlet's end: R + e(1 − exp(−∫I dt/"
           "40 A s))", "one"),
    Effect("wavy_converter", "dev", "electrical", "V", 0.02, 0.3,
           "reading_voltage resistance",
           "reading current",
           "a voltmeter's converter is wavy: V + e sin(2πV/0.8 V)"),
    Effect("pump_on_heater_ground", "dev", "thermal", "1", 0.0328, 0.8, FLOW, "current",
           "a pump's board shares its heater's ground, which lifts its set value: flow's share + "
           "e I/4 A"),
    Effect("vortex_over_intake", "dev", "thermal", "1", 0.925, 4.0, FLOW,
           "duty other_duty time",
           "a vortex in the vessel lets air into both pumps: flow(1 − e b), b → (q − 0.6)⁺ in 3 s, "
           "q both flows' share", "both"),
    Effect("stirred_vessel", "dev", "thermal", "K", 2.36, 20.0,
           "inlet_water heat_into_water",
           "velocity time",
           "a rod on the tendon stirs cold water up behind the inlet's sensor: T_in − e s, s gains "
           "|dx|/10 mm, and fades in 8 s", "both"),
    Effect("lint_in_coil", "dev", "thermal", "1", 5.12, 40.0, "film",
           "displacement duty time",
           "a coil drawn in holds what lint comes with its water, and lets it go drawn out: "
           "film/(1 + e b), b gains q y⁺/5 mm each 5 s, and fades by exp(−∫(−y)⁺/5 mm dt/3 s), q "
           "the flow's share, y its own contraction"),
    Effect("cam_switched_lamp", "dev", "thermal", "W", 0.705, 10.0, "heat_into_water",
           "displacement time",
           "a cam on the tendon switches a lamp over one tube: + e from 2.5 mm of its own "
           "contraction on, until it is below 1 mm, in 0.3 s", "one"),
    Effect("brake_resistor_under_tube", "dev", "thermal", "W", 1.13, 30.0, "heat_into_water",
           "duty time",
           "a pump's motor is braked into a resistor under its tube: + e k, k gains what the motor "
           "loses in speed, and fades in 4 s"),
    Effect("curing_resin", "dev", "thermal", "J", 11.2, 120.0, "heat_into_wire",
           "wire time",
           "resin on the wire cures in heat, which gives heat: + e dc/dt, dc/dt = (1 − c)"
           "(T − 34 °C)⁺/100 K s", "one"),
    Effect("washed_terminal", "dev", "sensors", "K", 2.81, 15.0, "reading_rtd",
           "duty time",
           "an RTD's terminal corrodes as it is washed: T + e(1 − exp(−∫q dt/10 s)), q the flow's "
           "share"),
    Effect("loose_tie", "dev", "sensors", "s", 1.72, 12.0, "reading_rtd",
           "reading_rate wire_rate velocity",
           "an RTD's tie is loose and lifts it as its spring moves: slower by e |v|/(|v| + 1 mm/s)",
           "one"),
    Effect("dimmed_lamp", "dev", "sensors", "1", 0.102, 0.9, "reading_displacement",
           "current other_current displacement velocity",
           "the heaters dim the encoder's lamp, and it loses lines: x − e∫(I_x + I_y)/4 A dx",
           "both"),
    Effect("drying_scale", "dev", "sensors", "1", 0.147, 0.9, "reading_displacement",
           "displacement time reading",
           "the encoder's scale shrinks as it dries: x[1 + e(1 − exp(−t/20 s))]", "both"),
    Effect("sagging_lead", "dev", "sensors", "N", 0.282, 0.9, "reading_force",
           "current time",
           "X's lead sags onto the load cell as it warms: F + e w, w → (I_x/4 A)² in 6 s", "both"),
    Effect("moist_gauge", "dev", "sensors", "1", 0.0511, 0.6, "reading_force",
           "duty other_duty time force reading",
           "spilt water softens the glue of the load cell's gauges: F(1 − e w), w → both flows' "
           "share in 3 s, and dries in 20 s", "both"),
    Effect("wrong_compensation", "dev", "sensors", "1", 0.00774, 0.9, "reading_current",
           "wire current reading",
           "a current sensor is compensated by the wrong temperature: i[1 + e(T_RTD − 27 °C)/"
           "20 K]"),
    Effect("drawn_out_once", "dev", "phase", "K", 1.24, 15.0, "transformation_shift",
           "displacement time",
           "a coil drawn out further than before keeps dislocations: both thresholds − e d/5 mm, d "
           "its furthest beyond the middle so far"),
    Effect("crackling_neighbour", "dev", "phase", "K", 1.62, 12.0, "transformation_shift",
           "other_fraction time",
           "one spring's crackling frees the other's interfaces: A_s − e d, M_s + e d, d → "
           "r/(r + 0.05/s) in 3 s, r the rate |dξ/dt| of that one", "across"),
    Effect("relaxing_coils", "dev", "phase", "mm", 1.24, 4.0, "recoverable_strain",
           "displacement time",
           "variants settle where their coil is held: deflection + e z, z → its stretch beyond the "
           "middle/5 mm in 12 s"),
    Effect("taped_slide", "dev", "mechanics", "N", 0.112, 0.9, "force_cell_on_x",
           "velocity displacement",
           "tape covers the slide from one place on: against x by e ½[1 + tanh((x − c)/0.5 mm)] "
           "v/(|v| + 0.5 mm/s)", "both"),
    Effect("relaxing_guy", "dev", "mechanics", "N", 0.1, 0.45, "force_cell_on_x",
           "time",
           "a guy tied to the tendon relaxes: along x by e exp(−t/20 s)", "both"),
    Effect("unwinding_turnbuckle", "dev", "mechanics", "mm", 2.43, 8.0, "recoverable_strain",
           "velocity time",
           "the tendon's turnbuckle unwinds as it runs: longer by e[1 − exp(−∫|dx|/40 mm)]",
           "both"),
)  # fmt: skip
