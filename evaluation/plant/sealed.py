"""Effects that nobody who works on the diagnosis reads before a bank of them is opened.

Where a forcing at another place would leave less than one floor of ten, that place is right, too.
The load cell is beside X, so that a force between the springs has one place.
"""

from evaluation.plant.effect import FLOW, TUBE, Effect

EFFECTS: tuple[Effect, ...] = (
    Effect("tugged_trimmer", "sealed", "electrical", "1", 0.00777, 0.3, "driven_current",
           "displacement current",
           "a heater's lead tugs at its driver's trimmer: I[1 + e y/5 mm], y its own contraction"),
    Effect("setpoint_ground", "sealed", "electrical", "A", 0.0261, 0.8, "driven_current",
           "other_duty",
           "the other pump's motor lifts a driver's ground: I − e w ≥ 0, w the motor's speed",
           "across"),
    Effect("fretted_crimp", "sealed", "electrical", "ohm", 0.0112, 0.4, "resistance",
           "velocity time",
           "a crimp frets as the tendon moves: R + e(1 − exp(−∫|dx|/30 mm))", "one"),
    Effect("lead_in_outlet", "sealed", "electrical", "ohm", 0.00841, 0.25,
           "resistance reading_voltage", "water wire",
           "a thin copper lead lies in its tube's outlet: R + e ΔT_w/20 K, and its heat there"),
    Effect("tarnished_crimp", "sealed", "electrical", "V", 0.0193, 0.6,
           "reading_voltage resistance", "current reading",
           "a tarnished crimp within the sense clips drops nearly the same at any current: "
           "V + e I/(I + 0.5 A)"),
    Effect("other_pump_shakes", "sealed", "thermal", "1", 0.419, 12.0, "film", "other_duty",
           "the other pump's pulses shake a coil in its water: film[1 + e q], q the other flow's "
           "share", "across"),
    Effect("hose_under_tendon", "sealed", "thermal", "1", 0.177, 0.95, FLOW, "force duty",
           "a taut tendon presses on a hose: flow[1 − e k], k from 0 at 1.24 N to 1 at 1.64 N",
           "one"),
    Effect("sinking_level", "sealed", "thermal", "1", 0.313, 1.5, FLOW,
           "duty other_duty time",
           "the vessel runs low: flow(1 − e l), l gains both flows' share each 20 s and loses "
           "itself in 50 s", "both"),
    Effect("warm_cartridge", "sealed", "thermal", "K", 3.14, 20.0, "inlet_water heat_into_water",
           "duty time",
           "a warm filter behind the inlet's sensor is flushed cool: T_in + e exp(−∫q dt/6 s), q "
           "the flow's share"),
    Effect("drawn_again", "sealed", "thermal", "1", 0.163, 0.9, "inlet_water heat_into_water",
           "water wire duty",
           "a coaxial fitting leaks from outlet to inlet: T_in + e(T_out − T_in)"),
    Effect("pressed_tube", "sealed", "thermal", "1", 2.79, 40.0, "heat_into_water",
           "force water",
           "a taut spring presses its tube on the base: loss(1 + e k), k from 0 at 1.24 N to 1 at "
           "1.64 N",
           "one"),
    Effect("metal_yoke", "sealed", "thermal", "W/K", 0.0689, 1.5, "heat_into_wire heat_into_water",
           "other_wire wire",
           "a metal yoke joins the springs' outlet ends: + e(T_other − T) between those",
           "both"),
    Effect("rtd_joints", "sealed", "sensors", "K", 1.89, 15.0, "reading_rtd", "duty water wire",
           "an RTD's two joints of unlike metals lie at the tube's ends: T + e(T_out − T_in)/10 K, "
           "of its wire there"),
    Effect("fatigued_rtd", "sealed", "sensors", "K", 3.0, 20.0, "reading_rtd",
           "time wire reading",
           "cycling cracks the joints of a two-wire RTD: T + e(1 − exp(−∫|dT|/60 K))", "one"),
    Effect("counted_motors", "sealed", "sensors", "mm/s", 0.0365, 0.25, "reading_displacement",
           "duty other_duty time",
           "the encoder counts the pump motors' sparks: x + e∫(w_x + w_y)dt, w a motor's speed",
           "both"),
    Effect("dragged_cable", "sealed", "sensors", "N", 0.0605, 0.4, "reading_force",
           "displacement",
           "the load cell's cable is dragged along by the tendon: F + e x/5 mm", "both"),
    Effect("amplifier_near_rail", "sealed", "sensors", "1", 0.0226, 0.9, "reading_current",
           "current reading",
           "a current amplifier bends near its rail: i − e(i − 2.5 A)⁺"),
    Effect("electron_wind", "sealed", "phase", "K", 1.23, 8.0, "transformation_shift",
           "current",
           "current itself eases the transformation: A_s − e I/4 A, M_s + e I/4 A"),
    Effect("deep_cooled", "sealed", "phase", "K", 1.07, 10.0, "transformation_shift",
           "wire fraction",
           "martensite that was cooled further turns back later: A_s + e(34 °C − T_min)⁺/5 K, "
           "T_min the lowest since ξ < ½"),
    Effect("two_phase_softening", "sealed", "phase", "1", 0.142, 1.2, "recoverable_strain",
           "fraction force",
           "a mixture of phases is softer than either: elastic deflection[1 + 4e ξ(1 − ξ)]"),
    Effect("hammered_variants", "sealed", "phase", "1", 0.133, 0.5, "recoverable_strain",
           "duty fraction time",
           "a pump's pulses turn martensite further: turned share + e∫q dt/10 s, q the flow's "
           "share, until it forms anew"),
    Effect("shrunk_sleeve", "sealed", "mechanics", "N", 0.121, 0.8, TUBE, "wire time",
           "a shrinkable sleeve draws a spring in for good: it pulls e m more, m the most of "
           "(T − 36 °C)⁺/15 K ≤ 1 so far"),
    Effect("loose_axle", "sealed", "mechanics", "mm", 1.25, 8.0, "recoverable_strain",
           "velocity displacement",
           "the tendon carries a pulley's loose axle along: it is longer by e b, b by dx/0.8 mm "
           "within ±1", "both"),
    Effect("drying_bearing", "sealed", "mechanics", "N", 0.156, 0.9, "force_cell_on_x",
           "velocity time",
           "a bearing's oil is rubbed away: e(1 − exp(−∫|dx|/40 mm)) v/(|v| + 0.5 mm/s)", "both"),
)  # fmt: skip

SIGNED = frozenset(("tugged_trimmer", "rtd_joints", "counted_motors", "dragged_cable"))
"""Those whose magnitude may be negative."""
