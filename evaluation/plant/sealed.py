"""Effects that nobody who works on the diagnosis reads before a bank of them is opened.

Where a forcing at another place would leave less than one floor of ten, that place is right, too.
The load cell is beside X, so that a force between the springs has one place.
"""

from evaluation.plant.effect import FLOW, Effect

EFFECTS: tuple[Effect, ...] = (
    Effect("absorbing_hold", "sealed", "electrical", "1", 0.00737, 0.8, "driven_current", "current",
           "the driver's hold capacitor soaks: I − e(I − z), z → I in 7 s"),
    Effect("driver_crosstalk", "sealed", "electrical", "1", 0.00826, 0.5, "driven_current",
           "other_current",
           "one bridge's switching lifts the other current: J + e(I − 1 A)⁺", "across"),
    Effect("shorted_coils", "sealed", "electrical", "1", 0.0133, 0.5, "resistance reading_voltage",
           "displacement",
           "drawn-in coils touch and short: R[1 − e(y − 1 mm)⁺/5 mm], y its own contraction"),
    Effect("cracked_end", "sealed", "electrical", "ohm", 0.00688, 0.5, "resistance reading_voltage",
           "force",
           "a crack at the outlet's end opens above 66 MPa and closes below 59 MPa: R + e, in "
           "0.3 s", "one"),
    Effect("lead_inductance", "sealed", "electrical", "mH", 1.51, 40.0, "reading_voltage",
           "reading_rate current reading",
           "sense and heater leads are laid in one loop: V + e dI/dt"),
    Effect("warmed_amplifier", "sealed", "electrical", "1", 0.0428, 0.5,
           "reading_voltage resistance", "other_current current reading",
           "a voltage amplifier beside the other driver warms: V(1 + e w), w → (J/4 A)² in "
           "8 s", "across"),
    Effect("leads_along_neighbour", "sealed", "thermal", "W", 2.05, 15.0, "heat_into_water",
           "other_current",
           "a heater's lead runs along the other tube: + e w W, w → (J/4 A)² in 10 s", "across"),
    Effect("coils_on_wall", "sealed", "thermal", "1", 3.02, 20.0, "film", "force",
           "slack coils lie on the tube's wall: film/[1 + e(1.5 N − F)⁺/0.3 N]"),
    Effect("kinked_hose", "sealed", "thermal", "1", 0.399, 0.95, FLOW, "displacement duty",
           "a spring drawn out kinks its hose: flow[1 − e k], k from 0 at 1 mm of its own "
           "contraction to 1 at −4 mm", "one"),
    Effect("driver_fan", "sealed", "thermal", "1", 2.72, 40.0, "heat_into_water",
           "water current other_current",
           "the drivers' fan blows on the tubes: loss(1 + e) once (I_x² + I_y²)/(4 A)², over "
           "12 s, passes 0.25, until it is below 0.12", "both"),
    Effect("sweating_tube", "sealed", "thermal", "W", 1.68, 20.0, "heat_into_water", "water",
           "water seeps through one tube and evaporates: − e[(T_w − 34 °C)⁺/10 K]²", "one"),
    Effect("soaked_rtd", "sealed", "sensors", "K", 3.56, 12.0, "reading_rtd", "wire reading",
           "a cracked RTD takes up water above 38 °C, at 10 K more within 5 s, and dries in "
           "40 s: T − e s", "one"),
    Effect("strained_rtd", "sealed", "sensors", "K", 1.72, 8.0, "reading_rtd",
           "reading_rate wire_rate reading wire",
           "glue strains the RTD, and slips: T − e b, b by dT/3 K within ±1"),
    Effect("lost_counts", "sealed", "sensors", "1", 0.19, 0.6, "reading_displacement",
           "velocity displacement reading time",
           "the decoder loses counts at speed: it misses e(|v| − 1.5 mm/s)⁺, either way", "both"),
    Effect("bracket_growth", "sealed", "sensors", "mm", 2.12, 10.0, "reading_displacement",
           "water wire",
           "the encoder's bracket is warmed by tube X, 25 s: x + e ΔT_w/20 K", "both"),
    Effect("cell_shock", "sealed", "sensors", "N", 0.315, 1.2, "reading_force", "wire_rate wire",
           "spring X warms the load cell's skin (2 s) before its core (12 s): F + e(s − c), of "
           "ΔT/20 K", "both"),
    Effect("hoses_on_cell", "sealed", "sensors", "N", 0.12, 0.6, "reading_force",
           "duty other_duty",
           "hoses under pressure lean on the load cell: F + e(q_x − 0.6 q_y), the flows' "
           "shares", "both"),
    Effect("hall_zero_drift", "sealed", "sensors", "A", 0.0351, 0.6, "reading_current",
           "current other_current",
           "both current sensors' zeros drift with their board: i + e w, w → (I_x² + I_y²)/"
           "(4 A)² in 20 s", "both"),
    Effect("premartensitic_peak", "sealed", "phase", "1", 1.15, 10.0, "heat_into_wire",
           "wire_rate wire",
           "heat capacity has a peak: C[1 + e exp(−((T − 40 °C)/3 K)²)], both ways"),
    Effect("turned_resists", "sealed", "phase", "K", 1.06, 8.0, "transformation_shift",
           "force fraction",
           "martensite that was turned further turns back later: A_s + e Δξ_S/0.05"),
    Effect("shaken_interfaces", "sealed", "phase", "K", 3.38, 12.0, "transformation_shift",
           "duty fraction_rate",
           "pumping shakes the phases' interfaces loose: A_s − e q, M_s + e q, q the flow's share"),
    Effect("creeping_crimp", "sealed", "mechanics", "mm", 0.566, 5.0, "recoverable_strain",
           "wire force time",
           "a glued end gives when hot: deflection + e∫(T_end − 40 °C)⁺/10 K F/1.24 N dt/10 s",
           "one"),
    Effect("stiff_grease", "sealed", "mechanics", "N", 0.257, 0.9, "force_cell_on_x", "velocity",
           "grease that stiffens at rest drags: e g v/(|v| + 0.5 mm/s), g lost over 4 mm and "
           "back in 8 s", "both"),
    Effect("iron_beside_tendon", "sealed", "mechanics", "N", 0.0784, 0.3, "force_cell_on_x",
           "displacement",
           "a magnet holds an iron clip: against x by e z exp[(1 − z²)/2], z = (x − c)/2.5 mm",
           "both"),
)  # fmt: skip
