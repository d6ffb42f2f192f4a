"""Effects of no list whose sealed bank was opened last: they have joined development banks.

Where a forcing at another place would leave less than one floor of ten, that place is right, too.
The load cell is beside X, so that a force between the springs has one place.
"""

from evaluation.plant.effect import FLOW, Effect

EFFECTS: tuple[Effect, ...] = (
    Effect("swallowed_pulses", "dev", "electrical", "A", 0.174, 3.0, "driven_current",
           "current",
           "a driver swallows pulses that are too short: I[1 − exp(−(I/e)²)]"),
    Effect("wrong_bit", "dev", "electrical", "A", 0.0224, 0.45, "driven_current", "current",
           "one bit of a driver's converter has a wrong weight: I + e wherever I/0.5 A, cut to a "
           "whole number, is odd"),
    Effect("starting_pumps", "dev", "electrical", "1", 0.0096, 0.8, "driven_current",
           "duty other_duty current",
           "starting pumps pull the drivers' supply down: I(1 − e d), d gains what a motor gains "
           "in speed, and fades in 3 s", "both"),
    Effect("leached_ions", "dev", "electrical", "1", 0.0223, 1.0,
           "resistance", "time duty",
           "ions leach into still water, which shunts its wire: R/(1 + e c), c → 1 in 20 s, swept "
           "out in 1.5 s by full flow"),
    Effect("shared_return", "dev", "electrical", "ohm", 0.00576, 0.4, "reading_voltage",
           "other_current",
           "both springs' currents return through one lead within the sense clips: V + e J",
           "both"),
    Effect("clogged_strainer", "dev", "thermal", "1", 0.305, 0.95, FLOW, "duty time",
           "what is pumped clogs a strainer: flow[1 − e(1 − exp(−∫q dt/8 s))], q the flow's share",
           "one"),
    Effect("thermosiphon", "dev", "thermal", "1", 0.0234, 0.8, FLOW, "water duty",
           "warm water rises through a slow pump: flow + e(1 − w)ΔT_w/10 K, w the motor's speed"),
    Effect("sticking_rotor", "dev", "thermal", "1", 0.638, 0.95, FLOW, "duty",
           "a pump's rotor sticks: at rest until its duty passes e, then on until it is below "
           "e/3", "one"),
    Effect("stirring_coils", "dev", "thermal", "1", 0.67, 12.0, "film", "velocity",
           "a moving coil stirs its own water: film[1 + e |v|/(|v| + 2 mm/s)]"),
    Effect("hot_crimp", "dev", "thermal", "W", 1.79, 8.0,
           "heat_into_wire heat_into_water", "current time",
           "crimps outside the sense clips heat the wire's ends: + e c, c → (I/4 A)² in 8 s",
           "one"),
    Effect("drawn_from_depth", "dev", "thermal", "K", 3.56, 15.0,
           "inlet_water heat_into_water", "duty other_duty",
           "pumping draws layered water up behind the inlet's sensor: T_in + e d, d → both flows' "
           "share in 4 s", "both"),
    Effect("wet_jacket", "dev", "thermal", "1", 5.98, 40.0, "heat_into_water", "duty water",
           "a joint sprays its tube while it is pumped: loss(1 + e m), m → the flow's share in "
           "3 s, and dries in 20 s"),
    Effect("ghosting_multiplexer", "dev", "sensors", "1", 0.161, 0.9, "reading_rtd",
           "other_wire wire reading",
           "a multiplexer is read before it settles: T + e(T_other − T), of both RTDs", "both"),
    Effect("creeping_tie", "dev", "sensors", "1", 0.102, 0.45, "reading_rtd",
           "displacement wire duty",
           "an RTD's tie is dragged along its wire: it reads e y/5 mm of the length further to "
           "the outlet, y its own contraction", "one"),
    Effect("coarse_scale", "dev", "sensors", "mm", 1.36, 6.0, "reading_displacement",
           "displacement reading",
           "the encoder has lost its fine track: it reads the nearest multiple of e", "both"),
    Effect("oblique_pull", "dev", "sensors", "1", 0.0243, 0.9, "reading_force",
           "displacement force reading",
           "off the middle the tendon pulls obliquely on its load cell: F[1 − e(x/5 mm)²]",
           "both"),
    Effect("remanent_core", "dev", "sensors", "A", 0.0134, 0.8, "reading_current",
           "current time",
           "a current sensor's core stays magnetised: i + e m, m the largest I/4 A, fading in "
           "30 s"),
    Effect("hydrogen_uptake", "dev", "phase", "K", 3.06, 15.0, "transformation_shift",
           "current time",
           "current charges the wire with hydrogen: both thresholds − e(1 − exp(−∫I dt/60 A s))"),
    Effect("warm_martensite", "dev", "phase", "mm", 2.44, 8.0, "recoverable_strain",
           "wire fraction force",
           "warm martensite gives more: deflection + e ξ F/1.24 N (T − 27 °C)⁺/10 K"),
    Effect("stiffening_austenite", "dev", "phase", "1", 0.114, 2.0, "recoverable_strain",
           "wire force fraction",
           "austenite stiffens with warmth: its elastic deflection/[1 + e(1 − ξ)(T − 35 °C)⁺/"
           "10 K]"),
    Effect("first_nuclei", "dev", "phase", "K", 6.88, 18.0, "transformation_shift",
           "fraction",
           "the first martensite lacks nuclei: M_s − e(1 − ξ/0.4)⁺"),
    Effect("relaxing_strap", "dev", "mechanics", "N", 0.055, 0.9, "force_cell_on_x",
           "displacement velocity",
           "a strap that relaxes ties the tendon to the frame: against x by e(x − z)/5 mm, z → x "
           "in 5 s", "both"),
    Effect("oval_pulley", "dev", "mechanics", "mm", 1.73, 2.5, "recoverable_strain",
           "displacement",
           "a pulley is oval: the tendon is longer by e sin(2πx/16 mm + c) − e sin c", "both"),
    Effect("snapping_bellows", "dev", "mechanics", "N", 0.054, 0.6, "force_cell_on_x",
           "displacement velocity",
           "a bellows on the tendon snaps over: along x by e from 1.5 mm past its middle on, the "
           "other way from 1.5 mm before it, in 0.2 s", "both"),
)  # fmt: skip
