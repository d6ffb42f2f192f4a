"""Effects that nobody who works on the diagnosis reads before a bank of them is opened."""

from evaluation.plant.effect import TUBE, Effect

EFFECTS: tuple[Effect, ...] = (
    Effect("shared_power_limit", "sealed", "electrical", "1", 0.022, 3.0, "driven_current",
           "current other_current",
           "both heaters share a power limit: past 8 W together, I/[1 + e(P/8 W − 1)], P "
           "over 0.5 s", "both"),
    Effect("coarse_driver", "sealed", "electrical", "A", 0.053, 0.8, "driven_current", "current",
           "the driver's converter has coarse steps: I to the nearest multiple of e"),
    Effect("clip_tension", "sealed", "electrical", "ohm", 0.014, 0.4, "reading_voltage",
           "force current",
           "crimped sense clips hold better under tension: V + I e[(1.24 N/F)² − 1]"),
    Effect("hot_clips", "sealed", "thermal", "W", 1.8, 6.0, "heat_into_wire", "current",
           "worn crimps heat the ends of the wire with e(I/4 A)², 8 s behind"),
    Effect("pump_waste_heat", "sealed", "thermal", "K", 8.6, 10.0, "inlet_water heat_into_water",
           "duty",
           "the pump's motor warms within 20 s as it runs and heats by e what it draws"),
    Effect("stirring_coils", "sealed", "thermal", "1", 0.59, 5.0, "film", "velocity",
           "moving coils stir the water they stand in: film[1 + e |v|/5 mm/s]"),
    Effect("rtd_bow", "sealed", "sensors", "K", 1.6, 6.0, "reading_rtd", "reading wire",
           "a curve trimmed at 27 and 57 °C bows between: T + 4e z(1 − z), z = (T − 27)/30"),
    Effect("shaft_bending", "sealed", "sensors", "mm", 1.6, 12.0, "reading_displacement", "force",
           "the encoder's shaft bends in its bearing with the tension: + e(F/1.24 N − 1)", "both"),
    Effect("cell_span_drift", "sealed", "sensors", "1", 0.125, 0.6, "reading_force",
           "water wire force reading",
           "the load cell sits on tube X, whose water warms it (20 s): F[1 + e ΔT/20 K]", "both"),
    Effect("ammeter_average", "sealed", "sensors", "s", 0.0053, 4.0, "reading_current",
           "current reading_rate reading",
           "the ammeter shows an average over e: one pole"),
    Effect("coil_expansion", "sealed", "phase", "mm", 1.26, 8.0, "recoverable_strain", "wire",
           "the wire's coils lengthen with heat: deflection + e ΔT/20 K, by its mean temperature"),
    Effect("hydrogen_uptake", "sealed", "phase", "K", 3.7, 12.0, "transformation_shift",
           "time current",
           "current in water charges the wire with hydrogen: both thresholds − e Q/(Q + 60 A s)"),
    Effect("clamp_slip", "sealed", "mechanics", "N", 0.026, 0.8, TUBE, "displacement velocity",
           "the tube slips in its clamp: a spring e/2 mm in parallel whose rest follows "
           "beyond 2 mm"),
    Effect("frame_growth", "sealed", "mechanics", "mm", 1.5, 8.0, "recoverable_strain",
           "current other_current wire",
           "the frame grows with the heaters' warmth, 45 s, and draws the tendon tighter by "
           "e", "both"),
    Effect("water_hammer", "sealed", "mechanics", "N", 0.176, 1.2, TUBE, "duty",
           "a starting or stopping pump jolts the tube along its spring: e times its speed "
           "less that 1.2 s ago"),
)  # fmt: skip
