"""Effects that nobody who works on the diagnosis reads before a bank of them is opened."""

from evaluation.plant.effect import FLOW, FORCE, Effect

EFFECTS: tuple[Effect, ...] = (
    Effect("tired_battery", "sealed", "electrical", "1", 0.024, 0.6, "driven_current",
           "current other_current",
           "a battery feeds both heaters: I(1 − e q), q → (I_x + I_y)/4 A in 40 s, and back",
           "both"),
    Effect("soft_start", "sealed", "electrical", "s", 0.0059, 4.0, "driven_current", "current",
           "the driver eases its current in, one pole of e; it lets it fall at once"),
    Effect("galvanic_clip", "sealed", "electrical", "V", 0.0145, 0.6, "reading_voltage", "wire",
           "one sense clip of another metal is a wet cell: V + e(T_c − 27 °C)/20 K, T_c → the "
           "outlet's wire in 4 s"),
    Effect("touching_tubes", "sealed", "thermal", "W/K", 0.041, 2.0, "heat_into_water",
           "other_wire water",
           "the tubes lie against each other: e W/K between the waters along them", "both"),
    Effect("lasting_swirl", "sealed", "thermal", "1", 1.3, 20.0, "film", "duty",
           "pumped water swirls on: still film(1 + e r), r the flow's share, fading in 6 s"),
    Effect("coasting_pump", "sealed", "thermal", "s", 0.6, 8.0, FLOW, "duty",
           "a heavy rotor turns on when its pump is turned down: e longer than it takes to run "
           "up", "one"),
    Effect("rtd_warmup", "sealed", "sensors", "K", 2.1, 15.0, "reading_rtd", "time",
           "an RTD's amplifier warms from the start on: T + e(1 − exp(−t/25 s))", "one"),
    Effect("coupling_creep", "sealed", "sensors", "1", 0.13, 0.8, "reading_displacement",
           "displacement reading velocity",
           "the encoder's rubber coupling gives: x − e(x − c), c → x in 6 s", "both"),
    Effect("cell_guide_friction", "sealed", "sensors", "N", 0.067, 0.5, "reading_force",
           "velocity displacement",
           "the load cell's guide rubs within the cell: F − e b, b by dx/0.3 mm within ±1", "both"),
    Effect("precipitation", "sealed", "phase", "K", 3.2, 15.0, "transformation_shift", "wire time",
           "nickel leaves the matrix in heat: both thresholds + e(1 − exp(−∫(T − 38)⁺dt/50 K s))"),
    Effect("plastic_ratchet", "sealed", "phase", "mm", 0.47, 4.0, "recoverable_strain",
           "transformed force",
           "transforming under load leaves the spring longer, by e ∫|dξ| τ/57 MPa"),
    Effect("warm_core", "sealed", "phase", "K", 1.9, 12.0, "transformation_shift",
           "current wire water duty",
           "the wire's core is warmer than its surface: thresholds − e q/10 W, q the film's heat"),
    Effect("rubber_anchor", "sealed", "mechanics", "mm", 1.55, 8.0, "recoverable_strain", "force",
           "a spring's anchor stands on rubber: deflection + e r, r → (F − 1.24 N)/0.4 N in 3 s",
           "one"),
    Effect("lip_seal", "sealed", "mechanics", "N", 0.12, 0.8, FORCE, "velocity",
           "the tendon passes a lip that drags one way only, by e v/(v + 1 mm/s)", "both"),
)  # fmt: skip
