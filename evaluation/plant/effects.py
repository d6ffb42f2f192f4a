"""The table of everything that can be added to the plant: listed causes and withheld ones.

`known` effects answer to an entry of the published list of candidates, in another form than the
obvious one. `dev` and `sealed` effects are on no list; a bank holds only one of the two kinds.
`spent` effects were sealed once and have become known; no bank draws them any more.
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

Kind = Literal["known", "dev", "spent", "sealed"]


@dataclass(frozen=True)
class Effect:
    """One physical effect: `usual` leaves about three floors, `limit` is the largest ever used."""

    name: str
    kind: Kind
    subsystem: str
    unit: str
    usual: float
    limit: float
    form: str


EFFECTS: tuple[Effect, ...] = (
    Effect("driver_gain", "known", "electrical", "1", 0.006, 0.2,
           "I = I_c[1 + g(1 − 0.08 I_c)]: the gain sags as the amplifier warms to its work"),
    Effect("driver_lag", "known", "electrical", "s", 0.01, 0.8,
           "two further equal poles after the current loop"),
    Effect("saturation", "known", "electrical", "1", 0.73, 4.0,
           "soft knee I/(1 + (I/I_s)^8)^(1/8), I_s = (4/e)(R0/R)(V/12)"),
    Effect("resistivity", "known", "electrical", "1", 0.026, 0.4,
           "R = R0[1 + e(a ΔT + b ΔT²) + e(ξ − ½)(1 + ½(ξ − ½))], quadratic in T and in ξ"),
    Effect("contact_resistance", "known", "electrical", "ohm", 0.04, 0.3,
           "series resistance that grows with its own heat over 8 s; in V only"),
    Effect("rtd_lag", "known", "sensors", "s", 0.08, 4.0, "two poles, e and 0.35 e"),
    Effect("rtd_stem_error", "known", "sensors", "1", 0.09, 0.4,
           "reads T − e(T − T_stem); the stem follows coil and ambient within 15 s"),
    Effect("rtd_offset", "known", "sensors", "K", 0.35, 6.0,
           "offset with a slope of 1 % of it per kelvin above 27 °C"),
    Effect("channel_delay", "known", "sensors", "s", 0.11, 0.6,
           "encoder and load cell read late, by e times 0.85–1.15 wandering over 20 s"),
    Effect("encoder_backlash", "known", "sensors", "mm", 0.26, 1.5,
           "play with a soft engagement over a third of its width"),
    Effect("encoder_slip", "known", "sensors", "1", 0.01, 0.2,
           "the tendon creeps on the shaft when moving under more than 1.4 N, both ways unequal"),
    Effect("force_offset", "known", "sensors", "N", 0.18, 0.4,
           "zero shift of which a fifth fades in over 25 s"),
    Effect("force_gain", "known", "sensors", "1", 0.26, 0.5, "F[1 + e(0.7 + 0.2 F)]"),
    Effect("force_creep", "known", "sensors", "1", 0.06, 0.3,
           "two relaxing elements, 4 s and 40 s, follow the load"),
    Effect("water_drain", "known", "thermal", "1/s", 0.001, 0.4,
           "the water leaves from the outlet end, cell by cell, while the pump rests; it refills"),
    Effect("air_bubbles", "known", "thermal", "1", 0.38, 0.95,
           "pockets enter at random and travel with the water, uncovering what they pass"),
    Effect("pump_dead_time", "known", "thermal", "s", 0.12, 1.5,
           "transport delay e and a second-order spin-up at 4/e rad/s, damping 0.6"),
    Effect("flow_shortfall", "known", "thermal", "1", 0.047, 0.8, "flow = (1 − e) duty^(1 + e)"),
    Effect("reservoir_warming", "known", "thermal", "1", 1.25, 6.0,
           "stratified reservoir warmed by what returns; the inlet sensor sees 30 % of it"),
    Effect("ambient_drift", "known", "thermal", "K", 2.5, 12.0,
           "draught: the air around the tubes leaves the ambient sensor by a half-sine"),
    Effect("valve_leak", "known", "thermal", "1", 0.02, 0.9,
           "the other tube gets e Q²/Q_max, as pressure opens the check valve"),
    Effect("cold_ends", "known", "thermal", "W/K", 0.0023, 0.06,
           "the end cells conduct to the clamps, the outlet end half as much"),
    Effect("convection_exponent", "known", "thermal", "1", 0.135, 2.0,
           "loss ∝ ΔT^(1+0.12+e) and static film ∝ ΔT^(0.15+e/2), equal at 15 K and 4 K"),
    Effect("minor_loop", "known", "phase", "K", 2.6, 8.0,
           "partial cycles: thresholds move with the fraction at the last reversal"),
    Effect("transformation_drift", "known", "phase", "K", 1.0, 10.0,
           "both centres fall and strain is lost, saturating in the transformed fraction"),
    Effect("r_phase", "known", "phase", "1", 0.054, 0.5,
           "cooling through 39 → 35 °C under load frees part of the strain before martensite"),
    Effect("stress_latent_heat", "known", "phase", "1", 0.62, 3.0,
           "L = L0[1 + e(τ/57 − 1)|τ/57|]"),
    Effect("tube_friction", "known", "mechanics", "N", 0.01, 0.5,
           "Stribeck with a term in the tension (capstan), through an elastic bristle"),
    Effect("viscous_drag", "known", "mechanics", "N", 0.05, 0.8,
           "e sign(v)(|v|/5 mm/s)^0.8, a third of it when the tube has drained"),
    Effect("tendon_compliance", "known", "mechanics", "mm", 1.7, 6.0,
           "stretch e ln(1 + F/0.4 N)/ln 4.1 relative to that at 1.24 N"),
    Effect("tube_stiffness", "known", "mechanics", "1", 0.1, 0.5,
           "hardening spring in parallel, softer when warm"),
    Effect("tendon_log_creep", "dev", "mechanics", "mm", 0.052, 2.0,
           "the tendon lengthens by e F ln(1 + t/3 s)"),
    Effect("rtd_current_pickup", "dev", "sensors", "K/A", 0.22, 3.0,
           "both RTD lines pick up the heater currents, mostly their own"),
    Effect("encoder_eccentricity", "dev", "sensors", "mm", 0.12, 1.0,
           "once-per-turn sine of an eccentric disc, turn 13 mm"),
    Effect("force_frame_warming", "dev", "sensors", "N", 0.025, 1.0,
           "the load cell's frame is warmed by the heaters, 45 s"),
    Effect("coil_contact", "dev", "mechanics", "1", 8.0, 80.0,
           "coils touch at short lengths and push, power 1.5"),
    Effect("shunt_self_heating", "dev", "electrical", "1", 0.02, 0.3,
           "the current shunt warms with I² over 10 s; the reading rises, the current does not"),
    Effect("tube_swelling", "dev", "thermal", "1", 0.8, 4.0,
           "the silicone bore widens with temperature: more water, thinner film"),
    Effect("pump_cavitation", "dev", "thermal", "1", 0.19, 0.97,
           "after long heating the pump first draws vapour and gas"),
    Effect("supply_beat", "dev", "electrical", "1", 0.0056, 0.3,
           "current breathes with the beat of supply ripple and PWM, 0.17–0.4 Hz"),
    Effect("rate_overshoot", "dev", "phase", "K", 1.0, 12.0,
           "nucleation lags: thresholds move apart with the square root of |dξ/dt|"),
    Effect("pump_bourdon", "dev", "mechanics", "N", 0.033, 1.0,
           "pump pressure straightens the coiled tube and pushes along the spring"),
    Effect("martensite_stabilisation", "dev", "phase", "K", 0.55, 10.0,
           "martensite left in peace ages: A_s rises with the logarithm of its rest"),
    Effect("rtd_strain", "spent", "sensors", "K", 1.4, 10.0,
           "the glued RTD is bent by the coil: its reading follows deflection"),
    Effect("tube_relaxation", "spent", "mechanics", "N", 0.025, 1.0,
           "viscoelastic tube: a Maxwell arm of 6 s in parallel"),
    Effect("water_shunt", "spent", "electrical", "1", 0.07, 0.6,
           "part of the current takes the warm water instead of the wire"),
    Effect("thermosiphon", "spent", "thermal", "1", 0.018, 0.3,
           "warm water rises by itself and draws fresh water while the pump rests"),
    Effect("reverse_flow", "spent", "thermal", "1", 0.1, 0.95,
           "after each pump pulse warm water runs back from the outlet"),
    Effect("driver_small_signal", "spent", "electrical", "A", 0.0105, 0.6,
           "crossover of the output stage eats small currents"),
    Effect("two_way_memory", "spent", "phase", "1", 0.26, 1.5,
           "trained wire: new martensite comes out partly turned as it once was"),
    Effect("spool_buildup", "spent", "sensors", "mm", 1.0, 6.0,
           "the tendon piles up on the shaft: reading with a square of travel"),
    Effect("rtd_flow_self_heating", "spent", "sensors", "K", 0.47, 6.0,
           "the RTD's own heat is carried away only when water flows"),
    Effect("pump_vibration", "spent", "mechanics", "N", 0.015, 0.4,
           "pump hum reaches the load cell and aliases to a slow tone"),
    Effect("aged_segment", "spent", "phase", "K", 1.0, 15.0,
           "one third of the wire, over-aged at the solder joint, transforms higher"),
    Effect("mux_ghosting", "spent", "sensors", "1", 0.0125, 0.5,
           "the converter keeps a share of the channel sampled before"),
    Effect("driver_foldback", "spent", "electrical", "1", 0.033, 2.0,
           "the output stage folds the current back once I² has warmed it, 9 s, past a threshold"),
    Effect("shared_return", "spent", "electrical", "ohm", 0.004, 0.3,
           "one return wire for both springs: each sense line reads its drop under both currents"),
    Effect("wire_strain_gauge", "spent", "electrical", "1", 0.017, 0.4,
           "the wire is its own strain gauge: R[1 + e(y + y²/4)], y the stretch in centimetres"),
    Effect("ratiometric_reference", "spent", "sensors", "1", 0.0038, 0.15,
           "the converter's reference sags with both currents; bridge and current readings rise"),
    Effect("force_hysteresis", "spent", "sensors", "N", 0.021, 0.4,
           "the load cell's foil keeps two plays, 0.08 N and 0.3 N, of its past load"),
    Effect("tube_wall_heat", "spent", "thermal", "J/K", 0.3, 8.0,
           "the silicone wall stores heat of its own and gives it back over 12 s"),
    Effect("hose_slug", "spent", "thermal", "K", 2.6, 15.0,
           "water that stood in the supply hose enters first, at the hose's temperature"),
    Effect("detwin_recovery", "spent", "phase", "1/s", 0.017, 1.0,
           "turned martensite springs back when unloaded, at e √(excess/0.1) of the excess"),
    Effect("friction_heat", "spent", "phase", "J", 1.8, 8.5,
           "moving phase fronts dissipate e for a whole transformation, in both directions"),
    Effect("clapeyron_bend", "spent", "phase", "K", 1.9, 30.0,
           "thresholds curve in stress, e((σ − 57)/30)² on heating and 0.4 of it on cooling"),
    Effect("shaft_imbalance", "spent", "mechanics", "N", 0.013, 0.08,
           "the weight of an unbalanced encoder arm pulls with the sine of the shaft's angle"),
    Effect("tube_thermal_push", "spent", "mechanics", "N", 0.06, 1.0,
           "the warm tube grows against its clamps and props its spring up"),
    Effect("pump_load_droop", "spent", "electrical", "1", 0.0037, 0.2,
           "pumps and heaters share a supply: I[1 − e D I/4 A], D the pumps' draw with its inrush"),
    Effect("core_remanence", "spent", "electrical", "A", 0.017, 0.4,
           "the current sensor's core keeps its largest field, fading over 12 s, and reads it"),
    Effect("tendon_angle", "spent", "sensors", "1", 0.042, 0.8,
           "the tendon leaves the load cell's axis with travel: F cos(0.2 + e x/cm)/cos 0.2"),
    Effect("converter_carry", "spent", "sensors", "K", 0.5, 6.0,
           "a step of the converter where its highest bit turns over, at one temperature"),
    Effect("pump_stiction", "spent", "thermal", "1", 0.09, 0.95,
           "the pump starts only at a duty of e and then turns down to a quarter of that"),
    Effect("warm_viscosity", "spent", "thermal", "1", 0.3, 3.0,
           "warm water is thinner: the pump drives more of it through a warm tube"),
    Effect("coil_pitch_film", "spent", "thermal", "1", 0.43, 4.0,
           "stretched coils stand in open water: the film grows with the spring's length"),
    Effect("arrest_memory", "spent", "phase", "K", 0.7, 15.0,
           "a heating that was broken off raises the next one's threshold where it had ended"),
    Effect("austenite_softening", "spent", "phase", "1", 0.2, 4.0,
           "austenite softens towards its transformation, K_A/[1 + e exp(−(T − 34)/6 K)]"),
    Effect("eased_turning", "spent", "phase", "MPa", 3.5, 40.0,
           "warm martensite turns at less stress, by e tanh((T − 27)/20 K)"),
    Effect("taut_lead", "spent", "mechanics", "N", 0.03, 1.0,
           "the heater's lead goes taut on one side of the travel and pulls back"),
    Effect("tendon_wetting", "spent", "mechanics", "mm", 0.4, 6.0,
           "the braided tendon soaks up what the pumps spill, lengthens, and dries over 40 s"),
    Effect("tendon_stray_current", "spent", "electrical", "1/ohm", 0.0095, 0.3,
           "the metal tendon joins both springs: e(V_x − V_y) leaves one wire for the other"),
    Effect("ripple_heating", "spent", "electrical", "1", 0.05, 0.8,
           "chopped current heats by its mean square: R[I² + e I(4 A − I)]"),
    Effect("worked_resistance", "spent", "electrical", "1", 0.023, 0.4,
           "defects left by transforming raise the resistance, R[1 + e(1 − exp(−Σ|Δξ|/4))]"),
    Effect("rtd_report_band", "spent", "sensors", "K", 0.45, 5.0,
           "the RTD's converter reports a new value only once it has moved by e"),
    Effect("overload_stop", "spent", "sensors", "1", 0.13, 0.95,
           "past a load its overload stop carries a share e of the rest beside the load cell"),
    Effect("reversal_miscount", "spent", "sensors", "mm", 0.015, 0.6,
           "the decoder gains e whenever the shaft turns round, always the same way"),
    Effect("gas_coat", "spent", "thermal", "1", 0.6, 12.0,
           "gas from warm water coats the wire, film/(1 + e c); it is swept off by the flow"),
    Effect("strainer_clogging", "spent", "thermal", "1", 0.07, 8.0,
           "silt gathers with the pumped water and throttles it; at rest it settles over 30 s"),
    Effect("phase_heat_capacity", "spent", "phase", "1", 0.8, 6.0,
           "austenite holds more heat than martensite, C[1 + e(1 − ξ)]"),
    Effect("overheated_nuclei", "spent", "phase", "K", 0.85, 6.0,
           "martensite starts later after overheating, by e(T_max − 38)/10 K of the last heating"),
    Effect("coil_opening", "spent", "mechanics", "1", 0.035, 0.6,
           "stretched coils open: the tendon's arm on the wire shrinks, exp(−e y), y in cm"),
    Effect("tendon_twist", "spent", "mechanics", "mm", 1.0, 6.0,
           "deflected springs turn their ends: its cord shortens, e y²/(1 + y²), y = x/5 mm + c"),
    Effect("idle_windup", "spent", "electrical", "1", 0.038, 0.5,
           "the current loop winds up while idle (5 s): I[1 + e w] until w has gone (0.6 s)"),
    Effect("clip_polarisation", "spent", "electrical", "V", 0.0145, 1.5,
           "wet sense clips polarise, V + e p: p → tanh(I/0.8 A) in 6 s, and fades over 15 s"),
    Effect("rail_kick", "spent", "electrical", "1", 0.028, 0.5,
           "what one current falls by flies back into the other side, e of it, and fades in 0.3 s"),
    Effect("rtd_binding", "spent", "sensors", "1", 0.18, 3.0,
           "what binds the RTD on keeps water off the coil below it: film/(1 + e) on that spot"),
    Effect("neighbour_field", "spent", "sensors", "1", 0.0045, 0.3,
           "the other side's lead acts on the current sensor: i + e j/(1 + i/4 A), j its current"),
    Effect("zero_tracking", "spent", "sensors", "1/s", 0.008, 2.0,
           "the load cell's indicator takes a still load near its tare for zero, and shifts to it"),
    Effect("roller_pulses", "spent", "thermal", "1", 0.13, 0.98,
           "a slow roller pump falters between rollers: flow[1 + e sin φ], φ by its turning"),
    Effect("overturning_water", "spent", "thermal", "W/K", 0.04, 3.0,
           "tubes hang inlet up: water colder there than at the outlet sinks, mixing e √(ΔT/10 K)"),
    Effect("phase_fronts", "spent", "phase", "K", 0.5, 4.0,
           "phases nucleate hard and spread easily: at a front either way begins e sooner"),
    Effect("quenched_martensite", "spent", "phase", "K", 1.2, 8.0,
           "martensite formed at rate r keeps stresses that help it back: A_s − e r/(r + 0.3 s⁻¹)"),
    Effect("tapered_drum", "spent", "mechanics", "1", 0.04, 0.25,
           "the encoder's drum tapers: dy/dx = 1 + e tanh(x/1 cm) between Y and X, forces alike"),
    Effect("rocking_anchor", "spent", "mechanics", "mm", 0.3, 2.0,
           "a loose anchor tips by e where tension passes 0.12–0.18 N over rest, back 0.1 N lower"),
    Effect("gate_refresh", "spent", "electrical", "1", 0.0125, 0.95,
           "the bridge's gate supply runs down at high current; refilling it takes e of 0.25 s"),
    Effect("shorted_turns", "spent", "electrical", "1", 0.02, 0.5,
           "coils that meet under current bridge, R(1 − e b); bridges part 1.5 mm further out"),
    Effect("pump_ground_lift", "spent", "electrical", "V", 0.009, 1.0,
           "the pumps' draw, inrush and all, lifts the ground of the sense lines: V + e D"),
    Effect("rtd_wandering", "spent", "sensors", "1", 0.085, 0.45,
           "the RTD rides on another stretch of wire as its spring moves: place + e x/cm"),
    Effect("tracking_decoder", "spent", "sensors", "s", 0.25, 0.8,
           "the encoder's decoder is a loop of second type, 1/e rad/s: it lags acceleration only"),
    Effect("range_switching", "spent", "sensors", "1", 0.045, 0.5,
           "the ammeter's low range reads i(1 + e): left above 1.2 A, taken again under 0.6 A"),
    Effect("evaporating_spill", "spent", "thermal", "W", 0.09, 1.0,
           "pumps spill on their tube, whose wet share w (dry in 40 s) gives off e w(p/p_dew − 1)"),
    Effect("wax_melting", "spent", "thermal", "J", 2.0, 9.0,
           "wax in the coil takes e to melt at 39 °C; wholly molten, it sets only from 34.5 °C"),
    Effect("pinned_fronts", "spent", "phase", "K", 0.5, 3.0,
           "bands of obstacles hold the fronts up: thresholds apart by e sin(6πξ + c), both ways"),
    Effect("grain_slopes", "spent", "phase", "1", 0.45, 6.0,
           "each grain has its own stress slope: curves widen by e(½ − ξ)(σ − 57) of their shift"),
    Effect("pressure_stiffening", "spent", "mechanics", "1", 0.2, 1.2,
           "a tube under pump pressure stiffens with it: a parallel spring that grows as flow²"),
    Effect("clinging_coils", "spent", "mechanics", "N", 0.06, 0.25,
           "wet coils that have closed cling to one another, and pull until 2.5 mm further out"),
    Effect("bridge_leakage", "sealed", "electrical", "A", 0.014, 0.4,
           "a hot bridge leaks: I + e(2^4h − 1)(1 − I/4 A), h its heat of I², 14 s"),
    Effect("soft_zener", "sealed", "electrical", "1", 0.028, 0.8,
           "a Zener across the sense lines takes e of what passes its knee, which sinks in 5 s"),
    Effect("pwm_counts", "sealed", "sensors", "mm/s", 0.002, 0.1,
           "the encoder counts edges of the heaters' PWM: e for each ampere above 1.5 A"),
    Effect("rtd_seepage", "sealed", "sensors", "K", 1.2, 12.0,
           "pumped water creeps under the RTD's glue and shunts it, reading low until dry again"),
    Effect("adaptive_filter", "sealed", "sensors", "s", 0.7, 20.0,
           "the load cell's indicator averages over e, but lets go the more the load is off"),
    Effect("tube_kink", "sealed", "thermal", "1", 0.08, 0.97,
           "a tube folds where its spring has shortened: e less flow, until 2 mm further out"),
    Effect("breathing_tube", "sealed", "thermal", "1", 0.04, 1.0,
           "a moving spring works its tube as a pump between valves: flow + e |v|/5 mm/s"),
    Effect("frame_touch", "sealed", "thermal", "W/K", 0.042, 1.0,
           "a short spring's tube bulges onto the frame, which warms (12 J/K) and cools in 40 s"),
    Effect("variant_creep", "sealed", "phase", "1", 0.02, 0.2,
           "martensite under load goes on turning, by e ln(1 + t/2 s) past its law"),
    Effect("deformed_martensite", "sealed", "phase", "K", 0.25, 5.0,
           "turned martensite is hard to turn back: A_s + e for each tenth, gone once formed anew"),
    Effect("knot_tightening", "sealed", "mechanics", "mm", 0.2, 6.0,
           "the knot draws tight under the largest load yet, and the tendon stays longer by it"),
    Effect("tube_buckling", "sealed", "mechanics", "N", 0.065, 0.6,
           "a tube pressed short pushes by e until it buckles; it straightens 1.3 mm further out"),
)  # fmt: skip

SIGNED = frozenset(
    (
        "driver_gain",
        "rtd_offset",
        "force_offset",
        "force_gain",
        "ambient_drift",
        "convection_exponent",
        "stress_latent_heat",
        "rtd_current_pickup",
        "force_frame_warming",
        "pump_bourdon",
        "rtd_strain",
        "spool_buildup",
        "hose_slug",
        "clapeyron_bend",
        "tendon_angle",
        "converter_carry",
        "neighbour_field",
        "tapered_drum",
        "pump_ground_lift",
        "rtd_wandering",
        "range_switching",
        "pwm_counts",
    )
)
"""Effects whose magnitude may be negative."""

BY_NAME = {effect.name: effect for effect in EFFECTS}
_SLOT = {effect.name: i for i, effect in enumerate(EFFECTS)}


def slot(name: str) -> int:
    """Column of one effect in the magnitude array of :func:`magnitudes`."""
    return _SLOT[name]


def names(kind: Kind) -> tuple[str, ...]:
    """Names of all effects of one kind, in the table's order."""
    return tuple(e.name for e in EFFECTS if e.kind == kind)


@dataclass(frozen=True)
class Active:
    """One effect at work: magnitude in the table's unit, spring Y's share, and a free shape."""

    name: str
    magnitude: float
    y_share: float = 1.0
    shape: float = 0.5


def magnitudes(active: tuple[Active, ...] = ()) -> NDArray[np.float64]:
    """Array (3, number of effects): magnitude on X, on Y, and the shape number in 0…1."""
    table = np.zeros((3, len(EFFECTS)))
    table[2] = 0.5
    for one in active:
        column = slot(one.name)
        table[:, column] = one.magnitude, one.magnitude * one.y_share, one.shape
    return table
