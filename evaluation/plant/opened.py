"""Effects of no list whose sealed bank was opened last: they have joined development banks.

Where a forcing at another place would leave less than one floor of ten, that place is right, too.
The load cell is beside X, so that a force between the springs has one place.
"""

from evaluation.plant.effect import FLOW, Effect

EFFECTS: tuple[Effect, ...] = (
    Effect("joining_stage", "dev", "electrical", "1", 0.00643, 0.6, "driven_current",
           "current time",
           "a driver's second stage joins in from a set value of 2.2 A on, until it is below "
           "1.4 A: I(1 + e m), m in 0.3 s"),
    Effect("changing_taps", "dev", "electrical", "1", 0.0149, 0.9, "driven_current",
           "current time",
           "a driver's supply changes taps where its set value passes 1 A + 2c A, either way: "
           "I(1 − e) for 0.5 s"),
    Effect("lead_over_other_motor", "dev", "electrical", "ohm", 0.0201, 0.3,
           "reading_voltage resistance",
           "other_duty current time",
           "a heater's copper lead lies over the other pump's motor: R + e w, w → that motor's "
           "speed in 8 s; in V only", "across"),
    Effect("swaying_reference", "dev", "electrical", "1", 0.0103, 0.5,
           "reading_voltage resistance",
           "time reading current",
           "a voltmeter's reference sways: V[1 + e sin(2πt/8 s + c)]"),
    Effect("ramped_pump", "dev", "thermal", "s", 1.7, 8.0, FLOW, "duty time",
           "a pump's board ramps it up, and lets it fall at once: the flow's share rises by at "
           "most 1 in e", "one"),
    Effect("self_cleaning_filter", "dev", "thermal", "1", 0.345, 0.95, FLOW, "duty time",
           "a filter clogs and flushes itself back: flow(1 − e b), b from 0 to 1 in every 4 s of "
           "full flow", "one"),
    Effect("cooler_on_spare_power", "dev", "thermal", "K", 4.07, 20.0,
           "inlet_water heat_into_water",
           "current other_current time",
           "a cooler behind the inlet's sensor has what power the heaters leave: T_in − e b, b → "
           "(1 − (I_x + I_y)/4 A)⁺ in 6 s", "both"),
    Effect("silt_of_other_return", "dev", "thermal", "1", 0.79, 40.0, "film",
           "other_duty duty time",
           "the other tube's return stirs silt into the feed, which stays on the coil: "
           "film/(1 + e b), b gains p each 8 s, and fades by exp(−∫q dt/3 s), q the flow's share, "
           "p the other's", "across"),
    Effect("chimney_over_tube", "dev", "thermal", "1", 2.81, 60.0, "heat_into_water",
           "water time",
           "air begins to draw along a tube that stays warm: loss(1 + e d), d → its ΔT_w⁺/10 K in "
           "8 s"),
    Effect("motion_detector_lamp", "dev", "thermal", "W", 0.44, 10.0,
           "heat_into_water ambient_air",
           "velocity time",
           "a motion detector switches a lamp over both tubes: + e m on each, m → 1 in 0.3 s "
           "until 5 s after |v| was above 1 mm/s, else → 0", "both"),
    Effect("supercooling_wax", "dev", "thermal", "J", 3.5, 20.0, "heat_into_wire",
           "wire_rate wire time",
           "wax on the wire melts from 38 to 42 °C, and sets only from 36 to 32 °C: − e dm/dt, m "
           "what is molten, in 0.5 s", "one"),
    Effect("warm_sleeve", "dev", "sensors", "s", 1.89, 12.0, "reading_rtd",
           "reading_rate wire_rate reading wire",
           "a sleeve round an RTD holds warm water back: where T falls, a pole of e", "one"),
    Effect("parting_rtd_joint", "dev", "sensors", "K", 2.51, 15.0, "reading_rtd",
           "displacement time",
           "a drawn-out coil parts a joint of its RTD: T + e from 2.5 mm of its own stretch "
           "beyond the middle on, until it is below 1 mm, in 0.2 s", "one"),
    Effect("slackening_string", "dev", "sensors", "mm", 2.07, 12.0, "reading_displacement",
           "velocity",
           "an encoder's string slackens where it is drawn in fast: x + e[(−v)⁺/5 mm/s]²", "both"),
    Effect("ringing_post", "dev", "sensors", "mm", 1.08, 8.0, "reading_displacement",
           "duty other_duty time",
           "the motors shake the encoder's post: x + e(r − w), w both motors' speeds, r that "
           "through an oscillator of 0.5 Hz, damping 0.1", "both"),
    Effect("charging_slide", "dev", "sensors", "N", 0.125, 0.9, "reading_force",
           "velocity time",
           "a sliding sheath charges the load cell's line: F + e c, c gains |dx|/10 mm, and fades "
           "in 4 s", "both"),
    Effect("eccentric_roller_on_cell", "dev", "sensors", "1", 0.0588, 0.9, "reading_force",
           "displacement force reading",
           "the load cell feels the tendon over an eccentric roller: F[1 + e sin(2πx/9 mm + c)]",
           "both"),
    Effect("zeroed_at_rest", "dev", "sensors", "A", 0.0335, 0.6, "reading_current",
           "current time",
           "a current sensor is zeroed whenever its heater is off, and drifts while it is on: "
           "i + e[1 − exp(−t/6 s)], t since I > 0.05 A, else i"),
    Effect("grains_with_play", "dev", "phase", "N", 0.242, 1.0, "transformation_shift",
           "force",
           "grains take a change of load only beyond their play: both thresholds + "
           "12 K/N (g − F), g follows F within e/2"),
    Effect("late_latent", "dev", "phase", "1", 0.367, 0.9, "heat_into_wire",
           "fraction_rate fraction time",
           "a part of the transformation's heat comes late: L(1 − e), and + e L z/6 s, z gains "
           "Δξ, and fades in 6 s"),
    Effect("bursting_variants", "dev", "phase", "1", 0.13, 0.6, "recoverable_strain",
           "fraction fraction_rate",
           "variants hold strain back and let it go in bursts: deflection + 12 mm (z − ξ), z is "
           "set to ξ where that is off by e"),
    Effect("turning_cam", "dev", "mechanics", "N", 0.116, 0.9, "force_cell_on_x",
           "velocity time",
           "a turning cam presses a pad on the tendon: against x by e sin²(πt/11 s + c) v/(|v| + "
           "0.5 mm/s)", "both"),
    Effect("dashpot_on_outlet", "dev", "mechanics", "N", 0.243, 0.9, "force_cell_on_x",
           "velocity water wire",
           "a dashpot's oil thins over X's outlet: against x by e exp(−w) v/5 mm/s, w → that "
           "one's ΔT_w⁺/10 K in 6 s", "both"),
    Effect("anchor_bolt_in_circuit", "dev", "mechanics", "mm", 3.08, 8.0,
           "recoverable_strain",
           "current time",
           "a spring's anchor bolt carries its current, and lengthens: deflection + e h, h → "
           "(I/4 A)² in 6 s", "one"),
)  # fmt: skip
