"""Effects of no list whose sealed bank was opened last: they have joined development banks.

Where a forcing at another place would leave less than one floor of ten, that place is right, too.
The load cell is beside X, so that a force between the springs has one place.
"""

from evaluation.plant.effect import FLOW, Effect

EFFECTS: tuple[Effect, ...] = (
    Effect("tapering_guard", "dev", "electrical", "1", 0.0189, 0.9, "driven_current",
           "wire current",
           "a guard in the driver tapers with its RTD: I[1 − e(T_RTD − 40 °C)⁺/10 K]"),
    Effect("ringing_loop", "dev", "electrical", "1", 0.0213, 0.8, "driven_current", "current",
           "a current loop rings: I + e(r − I), r the current through an oscillator of 1.2 Hz, "
           "damping 0.12"),
    Effect("overlapping_pulses", "dev", "electrical", "1", 0.0294, 0.6, "driven_current",
           "other_current current",
           "bridges that switch in step saturate their choke: each current − e min(I, J)", "both"),
    Effect("fraying_lead", "dev", "electrical", "ohm", 0.00457, 0.3,
           "resistance reading_voltage", "force",
           "strands of a lead tear under the largest load yet: R + e(F_max − 1.3 N)⁺/0.3 N",
           "one"),
    Effect("coil_in_field", "dev", "electrical", "V", 0.0297, 0.8, "reading_voltage", "velocity",
           "a magnet beside the coil induces in it as it moves: V + e v/5 mm/s, v that of its own "
           "contraction"),
    Effect("boiling_out_gas", "dev", "thermal", "1", 0.414, 8.0, "film", "wire water",
           "gas leaves the water on hot wire and stirs: film(1 + e b), b → 1 in 0.5 s from 4 K "
           "between them on, → 0 in 2 s below 1.5 K"),
    Effect("electrolysis_gas", "dev", "thermal", "1", 0.656, 8.0, "film", "current duty",
           "current splits water at the wire: film/(1 + e c), c, the gas on it, → I/4 A in 4 s, "
           "swept off in 1.5 s by full flow"),
    Effect("softening_hose", "dev", "thermal", "1", 0.176, 0.95, FLOW, "water duty",
           "a suction hose at the outlet softens with warmth: flow(1 − e w), w ≤ 1 → the outlet's "
           "ΔT_w/10 K in 5 s", "one"),
    Effect("relief_valve", "dev", "thermal", "1", 0.205, 0.95, FLOW, "duty",
           "a relief valve opens above 0.7 of the full flow and closes below 0.45: flow(1 − e) "
           "while open"),
    Effect("return_beside_intake", "dev", "thermal", "1", 0.245, 3.0,
           "inlet_water heat_into_water", "other_wire other_duty duty",
           "one tube returns its water beside the other's intake: T_in + e p, p gains "
           "q(T_out − T_in) each 5 s, q the returning flow's share, and fades in 40 s", "across"),
    Effect("shared_base", "dev", "thermal", "W/K", 0.05, 2.0, "heat_into_water",
           "water other_wire time",
           "both tubes lie on a base of 20 J/K: + e(T_base − T_w) in each", "both"),
    Effect("seated_end", "dev", "thermal", "W/K", 0.0335, 0.6, "heat_into_wire", "force wire",
           "a taut wire seats its inlet's end in the clamp: − e k(T − T_room) there, k from 0 at "
           "1.24 N to 1 at 1.64 N"),
    Effect("scanned_rtd", "dev", "sensors", "s", 1.2, 8.0, "reading_rtd",
           "reading_rate wire_rate reading wire",
           "a scanner comes to each RTD once in e and shows its last value until then"),
    Effect("dirty_strip", "dev", "sensors", "mm", 1.27, 5.8, "reading_displacement",
           "displacement reading",
           "dirt hides lines of the encoder's strip: over 6 mm round c it counts e less", "both"),
    Effect("damped_cell", "dev", "sensors", "N", 0.174, 1.2, "reading_force", "velocity",
           "oil in the load cell carries a part that grows with speed: F − e v/5 mm/s", "both"),
    Effect("loose_bolt", "dev", "sensors", "N", 0.0676, 0.6, "reading_force", "force reading",
           "the load cell's bolt shifts: F − e from 1.45 N on, until below 1.28 N, in 0.2 s",
           "both"),
    Effect("magnet_near_hall", "dev", "sensors", "A", 0.0235, 0.5, "reading_current",
           "displacement",
           "a magnet on the tendon nears both current sensors: i + e[(1 − x/25 mm)⁻² − 1]",
           "both"),
    Effect("stiff_matrix", "dev", "phase", "K", 4.57, 18.0, "transformation_shift", "fraction",
           "what has transformed strains the rest: both thresholds + e(½ − ξ)"),
    Effect("graded_wire", "dev", "phase", "K", 1.28, 8.0, "transformation_shift",
           "constant fraction wire",
           "nickel is unevenly spread: both thresholds − e at the inlet's end to + e at the "
           "outlet's", "one"),
    Effect("warm_slip_bands", "dev", "phase", "K", 1.41, 10.0, "transformation_shift",
           "velocity",
           "fast stretching warms slip bands within: both thresholds − e v/(|v| + 2 mm/s), v its "
           "own stretching, over 0.5 s"),
    Effect("yielding_austenite", "dev", "phase", "mm", 1.07, 12.0, "recoverable_strain",
           "force fraction",
           "stressed austenite turns martensitic here and there: deflection + e(1 − ξ)"
           "[(F − 1.4 N)⁺/0.3 N]²"),
    Effect("swinging_reel", "dev", "mechanics", "N", 0.132, 0.9, "force_cell_on_x",
           "velocity displacement",
           "a reel on soft cords swings after the tendon at 0.2 Hz, damping 0.15: against x by "
           "e(x − s)/5 mm, s its swing", "both"),
    Effect("rubber_buffer", "dev", "mechanics", "N", 0.024, 0.5, "force_cell_on_x",
           "displacement",
           "the tendon's clip meets a buffer 2 mm off the middle: it pushes back by "
           "e[(|x| − 2 mm)⁺/2 mm]^1.5, on one side", "both"),
    Effect("walking_anchor", "dev", "mechanics", "mm", 1.18, 6.0, "recoverable_strain",
           "duty time",
           "its pump's pulses walk a spring's anchor along: deflection + e∫q dt/5 s, q the "
           "flow's share", "one"),
)  # fmt: skip
