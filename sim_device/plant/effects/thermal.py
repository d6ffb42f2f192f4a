"""Candidate effects of heat flow and of the cooling water."""

from __future__ import annotations

from sim_device.plant import kernel as k
from sim_device.plant.effects.record import Y_SHARE, Effect, EffectParameter, about, either, half

_HEAT = ("temperature", "displacement", "force")
_WATER = (("cooling", ("water",)),)
_NODE = (("cooling", ("water",)), ("variant", ("extended",)))
_INCROPERA = (
    "F. P. Incropera et al., Fundamentals of Heat and Mass Transfer, Wiley (cited by the paper)"
)

THERMAL: tuple[Effect, ...] = (
    Effect(
        "ambient_drift",
        "the room warms or cools during a run",
        "thermal",
        "T_a(t) = T_a + r t",
        (EffectParameter("rate_K_s", k.E_DRIFT, "K/s", -0.1, 0.1, 0.02, either(0.02), "rate r"),),
        ("ambient", "temperature", "displacement", "force"),
        ("reservoir_warming", "rtd_offset"),
        "rest isotherm before and after a run",
        "definition; the ambient RTD shows it",
    ),
    Effect(
        "cold_ends",
        "wire ends at the crimps stay cold",
        "thermal",
        "δ = (1 − s) δ(ξ, ξ_S) + s δ(1, ξ_S,cold), ξ_S,cold by Eq. (12);"
        " the crimps, as warm as the air, take q = G (T − T_a)",
        (
            EffectParameter("share", k.E_COLD_ENDS, "1", 0, 0.5, 0.08, half(0.06), "share s"),
            EffectParameter("loss_W_K", k.E_END_LOSS, "W/K", 0, 0.1, 0.01, half(0.01), "G"),
        ),
        _HEAT,
        ("temperature_spread", "tube_stiffness"),
        "slow against fast heating: cold ends stay, a spread closes",
        "A. Bhattacharyya et al., Smart Mater. Struct. 2002 (heat balance cited by the paper)",
    ),
    Effect(
        "temperature_spread",
        "temperature is not uniform along and across the wire",
        "thermal",
        "f(a) → ½ f(a) + ¼ [f(a − Δ) + f(a + Δ)], Δ = ΔT/(A_F − A_S)",
        (EffectParameter("spread_K", k.E_SPREAD, "K", 0, 10, 2.5, half(2), "half width ΔT"),),
        _HEAT,
        ("cold_ends", "rtd_lag", "minor_loop"),
        "slow against fast heating: rounded corners sharpen when slow",
        "A. Bhattacharyya et al., Smart Mater. Struct. 2002 (heat balance cited by the paper)",
    ),
    Effect(
        "cooling_front",
        "the water cools the wire from its inlet on",
        "thermal",
        "five cells along the tube, C_w′ dT_w,i/dt = h π d (T_i − T_w,i) − …"
        " − 5 (Qρc/L)(T_w,i − T_w,i−1); RTD: T_r = T + s (T_z − T), outflow: T_w + s (T_w,5 − T_w)",
        (
            EffectParameter("share", k.E_FRONT, "1", 0, 1, 0.8, half(0.5), "share s of plug flow"),
            EffectParameter(
                "place", k.E_PLACE, "1", 0.02, 1, 0.5, about(0.5), "place z of the RTD", None
            ),
        ),
        _HEAT,
        ("temperature_spread", "rtd_lag", "flow_shortfall"),
        "one short and one long pump pulse from the same temperature",
        "physics.md of this project; plug flow against a stirred tank",
        _NODE,
        law=True,
    ),
    Effect(
        "convection_exponent",
        "film coefficient depends on the temperature difference in another way",
        "thermal",
        "h → h (|ΔT|/ΔT_0)^n;  UA′ → UA′ (|T_w − T_a|/ΔT_0)^m",
        (
            EffectParameter(
                "exponent", k.E_EXPONENT, "1", -0.5, 0.5, 0.2, either(0.15), "n, wire to water"
            ),
            EffectParameter(
                "loss_exponent",
                k.E_LOSS_EXPONENT,
                "1",
                -0.5,
                2.0,
                0.2,
                either(0.15),
                "m, tube to air",
            ),
            EffectParameter(
                "reference_K", k.E_EXPONENT_REF, "K", 2, 80, 10, about(10), "ΔT_0, no change", None
            ),
        ),
        _HEAT,
        ("rtd_stem", "flow_shortfall", "driver_gain"),
        "a long cool-down from two temperatures",
        _INCROPERA,
        law=True,
    ),
    Effect(
        "thermal_crosstalk",
        "heat passes from one spring to the other",
        "thermal",
        "q = G_x (T_other − T)",
        (
            EffectParameter(
                "conductance_W_K", k.E_CROSSTALK, "W/K", 0, 0.5, 0.02, half(0.02), "G_x"
            ),
        ),
        _HEAT,
        ("valve_leak", "ambient_drift"),
        "heat one side only and watch the other at rest, dry",
        _INCROPERA,
    ),
    Effect(
        "tube_wall",
        "the silicone tube stores heat",
        "thermal",
        "κ C_w′ dT_t/dt = G_t (T_w − T_t), taken from the water",
        (
            EffectParameter(
                "capacity_ratio", k.E_WALL, "1", 0, 3, 0.5, half(0.5), "κ: wall to water"
            ),
            EffectParameter(
                "conductance_W_mK",
                k.E_WALL_G,
                "W/(m K)",
                0.05,
                10,
                1.0,
                about(1.0),
                "water to wall G_t",
                None,
            ),
        ),
        _HEAT,
        ("water_drainage", "reservoir_warming"),
        "two heating pulses with a short and a long pause",
        _INCROPERA,
        _NODE,
        law=True,
    ),
)

WATER: tuple[Effect, ...] = (
    Effect(
        "water_warming",
        "the water in the tube warms up (missing from the printed model)",
        "water",
        "(1/κ) C_w′ dT_w/dt = h π d (T − T_w) − (Qρc/L)(T_w − T_in) − UA′ (T_w − T_a)",
        (
            EffectParameter(
                "inverse_share", k.E_WARMING, "1", 0, 10, 1.0, half(2), "κ = 1/φ; 0 never warms"
            ),
        ),
        _HEAT,
        ("driver_gain", "convection_exponent"),
        "hold a constant current in static water for a minute",
        "physics.md of this project; energy balance of the water in the tube",
        (("cooling", ("water",)), ("variant", ("printed",))),
    ),
    Effect(
        "water_drainage",
        "water leaves the tube after the pump stops",
        "water",
        "dw/dt = −(w − (1 − s))/τ while the pump rests; it refills the tube",
        (
            EffectParameter("share", k.E_DRAINAGE, "1", 0, 0.95, 0.5, half(0.3), "lost share s"),
            EffectParameter(
                "tau_s", k.E_DRAINAGE_S, "s", 0.1, 100, 5, about(5), "time constant τ", None
            ),
            Y_SHARE,
        ),
        _HEAT,
        ("tube_wall", "air_pockets"),
        "the first heating after cooling, with dwells of different length",
        "the paper, sections 6 and 7: retained water, leaks at the seals",
        _WATER,
    ),
    Effect(
        "air_pockets",
        "air bubbles cut the cooling by a different share at each start of the pump",
        "water",
        "h → h (1 − s v_n), Q → Q (1 − s v_n), v_n scattered in 0 to 1 with the n-th start",
        (
            EffectParameter("share", k.E_POCKETS, "1", 0, 0.95, 0.5, half(0.3), "largest share s"),
            Y_SHARE,
        ),
        _HEAT,
        ("flow_shortfall", "pump_lag"),
        "ten equal pump pulses: bubbles scatter, a shortfall does not",
        "the paper, section 7: tube dimensions to achieve a smoother water flow",
        _WATER,
    ),
    Effect(
        "pump_lag",
        "the pump starts late and spins up",
        "water",
        "Q = 0 for t_d after the start, then τ dQ/dt = Q_c − Q",
        (
            EffectParameter("dead_s", k.E_DEAD_S, "s", 0, 3, 0.3, half(0.3), "dead time t_d"),
            EffectParameter("spinup_s", k.E_SPINUP_S, "s", 0, 3, 0.4, half(0.4), "τ"),
            Y_SHARE,
        ),
        _HEAT,
        ("flow_shortfall", "channel_delay"),
        "pump pulses of many widths",
        "K. Ogata, Modern Control Engineering (dead time and first-order lag)",
        _WATER,
        law=True,
    ),
    Effect(
        "flow_shortfall",
        "less water flows than the pump's data say",
        "water",
        "Q → (1 − s) Q",
        (
            EffectParameter(
                "share", k.E_SHORTFALL, "1", -0.5, 0.95, 0.3, either(0.3), "missing share s"
            ),
            Y_SHARE,
        ),
        _HEAT,
        ("air_pockets", "convection_exponent", "uneven_flow"),
        "cool at two pump duties",
        "the paper, section 7: better seal to prevent water leakage",
        _WATER,
    ),
    Effect(
        "uneven_flow",
        "one tube gets more water than the other",
        "water",
        "Q_X → (1 + s) Q_X, Q_Y → (1 − s) Q_Y",
        (EffectParameter("share", k.E_UNEVEN, "1", -0.9, 0.9, 0.3, either(0.25), "share s"),),
        _HEAT,
        ("flow_shortfall", "valve_leak"),
        "cool each side alone from the same temperature",
        "the paper, section 7: smoother water flow",
        _WATER,
    ),
    Effect(
        "reservoir_warming",
        "the heat carried off warms the reservoir",
        "water",
        "T_in = T_in,0 + Q_out/C_r, C_r the heat capacity of the reservoir",
        (EffectParameter("inverse_J_K", k.E_RESERVOIR, "K/J", 0, 0.1, 0.01, half(0.01), "1/C_r"),),
        ("inlet", "temperature", "displacement", "force"),
        ("ambient_drift", "rtd_offset", "tube_wall"),
        "rest isotherm with the pump running, before and after a run",
        "energy balance of a stirred reservoir",
        _WATER,
    ),
    Effect(
        "valve_leak",
        "part of one side's water reaches the other side",
        "water",
        "Q_X → Q_X + s Q_Y, Q_Y → Q_Y + s Q_X",
        (
            EffectParameter("share", k.E_LEAK, "1", 0, 0.9, 0.15, half(0.15), "leaking share s"),
            Y_SHARE,
        ),
        _HEAT,
        ("thermal_crosstalk", "uneven_flow"),
        "hold one side hot and pump the other",
        "the paper, section 7: water leakage",
        _WATER,
    ),
)
