"""Effects of no list whose sealed bank was opened last: they have joined development banks.

Where a forcing at another place would leave less than one floor of ten, that place is right, too.
The load cell is beside X, so that a force between the springs has one place.
"""

from evaluation.plant.effect import FLOW, TUBE, Effect

EFFECTS: tuple[Effect, ...] = (
    Effect("cold_reference", "dev", "electrical", "1", 0.0138, 0.5, "driven_current",
           "time current",
           "a driver's reference is cold at the start: I[1 + e exp(−t/20 s)]"),
    Effect("plug_under_tension", "dev", "electrical", "1", 0.00737, 0.8, "driven_current",
           "force current",
           "a taut spring draws its heater's plug out: I[1 − e k], k from 0 at 1.24 N to 1 at "
           "1.64 N", "one"),
    Effect("curing_glue", "dev", "electrical", "ohm", 0.0112, 0.12, "resistance", "wire time",
           "silver glue at the inlet's end cures in heat: R − e(1 − exp(−∫(T − 32 °C)⁺dt/"
           "100 K s))", "one"),
    Effect("pressed_crimp", "dev", "electrical", "ohm", 0.0117, 0.12,
           "resistance reading_voltage", "duty",
           "a pump's pressure squeezes the seal on the outlet's crimp, which creeps back: R − e p, "
           "p the flow's share, fading in 12 s"),
    Effect("strobed_sense", "dev", "electrical", "V", 0.0275, 0.8,
           "reading_voltage resistance", "time current",
           "sampling beats with the chopped voltage: V + e I(4 A − I)/4 A² sin(2πt/9 s + c)"),
    Effect("bubbles_of_filling", "dev", "thermal", "1", 0.715, 8.0, "film", "duty time",
           "bubbles stay on the wire as the tube is filled, and are flushed off: film/"
           "[1 + e exp(−∫q dt/5 s)], q the flow's share"),
    Effect("shed_oxide", "dev", "thermal", "1", 0.803, 8.0, "film", "transformed",
           "transforming cracks scale off the wire: film[1 + e(1 − exp(−Σ|Δξ|/1.5))]"),
    Effect("air_cushion", "dev", "thermal", "1", 0.267, 1.0, FLOW, "duty",
           "air in a feeding hose swings with the water: flow + e(r − flow), r the flow through "
           "an oscillator of 0.2 Hz, damping 0.12"),
    Effect("wax_thermostat", "dev", "thermal", "1", 0.251, 0.95, FLOW, "water duty",
           "a thermostat at the outlet opens above 42 °C and closes below 36 °C: flow(1 − e) "
           "until it is open", "one"),
    Effect("dead_leg", "dev", "thermal", "W/K", 0.245, 4.0, "heat_into_water",
           "duty water time",
           "a blind branch of 6 J/K lies beside the outlet: + e q(T_branch − T_w) there, q the "
           "flow's share"),
    Effect("intake_on_tendon", "dev", "thermal", "K", 2.12, 20.0,
           "inlet_water heat_into_water", "displacement duty",
           "the tendon lifts the intake through layers of warmth: T_in + e x/5 mm", "both"),
    Effect("elastocaloric", "dev", "thermal", "W", 1.28, 8.0, "heat_into_wire", "velocity",
           "stretching warms the wire and letting go cools it: + e v/5 mm/s, v its own "
           "stretching, over 0.3 s"),
    Effect("rtd_on_straining_wire", "dev", "sensors", "K", 2.95, 20.0, "reading_rtd",
           "fraction",
           "what the wire gains in girth strains the RTD glued to it: T + e(1 − ξ)"),
    Effect("motor_lead_on_rtd", "dev", "sensors", "K", 3.33, 20.0, "reading_rtd",
           "other_duty",
           "the other pump's lead lies on an RTD's, which rectifies its sparks: T + e w, w that "
           "motor's speed", "across"),
    Effect("settling_encoder", "dev", "sensors", "mm", 0.707, 8.0, "reading_displacement",
           "time",
           "the encoder's freshly tightened clamp settles: x + e(1 − exp(−t/20 s))", "both"),
    Effect("overloaded_cell", "dev", "sensors", "N", 0.0467, 0.8, "reading_force",
           "force time",
           "loads beyond its range shift the load cell's zero: F + e(F_max − 1.3 N)⁺/0.3 N",
           "both"),
    Effect("core_at_low_field", "dev", "sensors", "1", 0.106, 0.95, "reading_current",
           "current reading",
           "a sensor's core is less permeable at low field: i[1 − e exp(−i/0.8 A)]"),
    Effect("hurried_cooling", "dev", "phase", "K", 4.25, 20.0, "transformation_shift",
           "wire_rate",
           "martensite takes time to nucleate: M_s − e r/(r + 1 K/s), r the wire's cooling over "
           "0.3 s"),
    Effect("electroplastic", "dev", "phase", "1", 0.07, 0.8, "recoverable_strain",
           "current force",
           "current eases dislocations: elastic deflection[1 + e(I/4 A)²]"),
    Effect("relaxing_lattice", "dev", "phase", "K", 2.42, 15.0, "transformation_shift",
           "time",
           "stresses of the mounting relax: both thresholds + e(1 − exp(−t/30 s))"),
    Effect("gripped_ends", "dev", "phase", "K", 2.83, 18.0, "transformation_shift",
           "fraction wire",
           "clamps hinder the wire's ends: A_s + e, M_s − e in a sixth at either end", "one"),
    Effect("damping_martensite", "dev", "mechanics", "N", 0.0989, 0.8, TUBE,
           "velocity fraction",
           "martensite damps: the spring pulls e ξ v/(|v| + 0.5 mm/s) more, v its own stretching"),
    Effect("clip_drawn_to_coils", "dev", "mechanics", "N", 0.104, 0.9, "force_cell_on_x",
           "velocity current other_current",
           "the coils' field draws an iron clip on the tendon to its guide: e(I_x² + I_y²)/"
           "(4 A)² v/(|v| + 0.5 mm/s)", "both"),
    Effect("splice_over_pulley", "dev", "mechanics", "mm", 1.34, 10.0, "recoverable_strain",
           "displacement",
           "a thick splice rides over a pulley: the tendon is longer by e tanh((x − c)/2 mm)",
           "both"),
)  # fmt: skip
