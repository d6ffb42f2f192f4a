"""Effects of no list whose sealed bank was opened last: they have joined development banks.

Where a forcing at another place would leave less than one floor of ten, that place is right, too.
The load cell is beside X, so that a force between the springs has one place.
"""

from evaluation.plant.effect import FLOW, Effect

EFFECTS: tuple[Effect, ...] = (
    Effect("play_in_variac", "dev", "electrical", "A", 0.0327, 1.5, "driven_current",
           "current",
           "a driver's variac has play: the current follows its set value within e/2, and is off "
           "at zero"),
    Effect("calibrating_driver", "dev", "electrical", "1", 0.0126, 0.9, "driven_current",
           "time current",
           "a driver calibrates itself for 1 s in every 9 s, from c on: then I(1 − e)"),
    Effect("ordering_austenite", "dev", "electrical", "1", 0.0278, 0.6,
           "resistance reading_voltage",
           "fraction time",
           "austenite orders at rest and conducts better: R(1 − e o), o → 1 − ξ in 8 s"),
    Effect("averaging_voltmeter", "dev", "electrical", "1", 0.0276, 0.95, "reading_voltage",
           "reading_rate time current",
           "a voltmeter averages with what it keeps once in 0.5 s: V − e(V − z), z that"),
    Effect("unprimed_hose", "dev", "thermal", "1", 0.27, 0.95, FLOW, "duty time",
           "air in a new hose is carried off as it is pumped: flow[1 − e exp(−∫q dt/8 s)], q the "
           "flow's share", "one"),
    Effect("shaking_pump", "dev", "thermal", "1", 0.783, 0.95, FLOW, "duty",
           "a pump shakes at part speed and draws less: flow[1 − e exp(−((w − 0.55)/0.15)²)], w "
           "its speed", "one"),
    Effect("feed_wound_on_tube", "dev", "thermal", "1", 0.777, 4.0,
           "inlet_water heat_into_water",
           "water duty time",
           "the feeding hose is wound round its own tube: T_in + e g/(1 + 4q), g → the mean T_w − "
           "T_in in 4 s, q the flow's share"),
    Effect("frothing_pump", "dev", "thermal", "1", 0.641, 40.0, "film", "duty time",
           "a pump froths at part speed, which keeps water off the coil: film/(1 + e b), b → "
           "4w(1 − w) in 0.5 s, w its speed, and fades in 6 s"),
    Effect("thermostat_belt", "dev", "thermal", "W", 0.574, 8.0, "heat_into_water",
           "water time",
           "a belt against frost heats its tube below 30 °C, until it is at 33 °C: + e", "one"),
    Effect("regulator_on_tube", "dev", "thermal", "W", 1.1, 20.0, "heat_into_water",
           "current time",
           "the driver's linear regulator is strapped to its tube: + e h, h → I(4 A − I)/4 A² in "
           "5 s"),
    Effect("unlike_crimp", "dev", "thermal", "V", 0.103, 3.0,
           "heat_into_wire recoverable_strain",
           "current",
           "an unlike metal in the inlet's crimp is warmed by the current (Peltier): + e I there",
           "one"),
    Effect("setting_paste", "dev", "sensors", "s", 1.96, 8.0, "reading_rtd",
           "reading_rate wire_rate reading wire",
           "the paste round an RTD sets when cold: a pole of e(1 − m), m from 0 at 32 °C to 1 at "
           "42 °C"),
    Effect("sparing_logger", "dev", "sensors", "s", 3.56, 8.0, "reading_rtd",
           "reading_rate wire_rate velocity time",
           "a logger spares itself while the tendon rests: it reads both RTDs anew after "
           "e/(1 + |v|/0.2 mm/s)", "both"),
    Effect("wet_measuring_wheel", "dev", "sensors", "1", 0.132, 0.9, "reading_displacement",
           "displacement duty other_duty velocity",
           "spilt water lets the encoder's wheel slip: x − e∫w dx, w → both flows' share in 3 s, "
           "and dries in 20 s", "both"),
    Effect("lifting_head", "dev", "sensors", "mm", 1.25, 6.0, "reading_displacement",
           "velocity",
           "the encoder's head lifts as the scale runs, either way: x + e |v|/(|v| + 1 mm/s)",
           "both"),
    Effect("drops_on_cell", "dev", "sensors", "N", 0.122, 0.9, "reading_force",
           "duty time",
           "drops of X's outlet gather on the load cell and fall: F + e d, d from 0 to 1 in every "
           "5 s of X's full flow", "both"),
    Effect("indicator_waits_for_pumps", "dev", "sensors", "s", 2.6, 8.0, "reading_force",
           "duty other_duty reading_rate force",
           "the load cell's indicator waits while a pump changes speed by more than 0.5/s, and "
           "for e more: it shows its last value", "both"),
    Effect("sampled_at_valley", "dev", "sensors", "1", 0.02, 0.6, "reading_current",
           "current reading",
           "a chopped current is sampled at its valley: i − e I(4 A − I)/4 A"),
    Effect("hydrogen_of_flow", "dev", "phase", "K", 3.89, 15.0, "transformation_shift",
           "duty wire time",
           "running water charges the wire with hydrogen, which warmth drives out: both thresholds "
           "− e h, h gains [q(1 − h) − h(T − 35 °C)⁺/10 K] each 10 s, q the flow's share"),
    Effect("training_under_load", "dev", "phase", "K", 4.39, 15.0, "transformation_shift",
           "fraction force time",
           "austenite held under load is trained: M_s + e(1 − exp(−∫(1 − ξ)F/1.24 N dt/15 s))"),
    Effect("young_martensite", "dev", "phase", "1", 0.487, 3.0, "recoverable_strain",
           "fraction_rate force time",
           "martensite is soft while it is young: elastic deflection(1 + e y), y gains Δξ⁺, and "
           "fades in 10 s"),
    Effect("tapering_dashpot", "dev", "mechanics", "N", 0.0724, 0.9, "force_cell_on_x",
           "velocity displacement",
           "a dashpot's bore tapers: against x by e exp(x/4 mm) v/5 mm/s", "both"),
    Effect("wet_felt", "dev", "mechanics", "N", 0.0976, 0.9, "force_cell_on_x",
           "velocity duty other_duty time",
           "spilt water swells a felt that rubs on the tendon: against x by e w v/(|v| + "
           "0.5 mm/s), w → both flows' share in 3 s, and dries in 20 s", "both"),
    Effect("bimetal_tongue", "dev", "mechanics", "N", 0.202, 0.45, "force_cell_on_x",
           "water other_wire time",
           "a bimetal between the outlets leans on the tendon: along x by e b, b → (X's T_w − "
           "Y's)/20 K there, in 6 s", "both"),
)  # fmt: skip
