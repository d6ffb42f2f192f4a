"""Candidate effects of heat flow."""

from __future__ import annotations

from sim_device.plant.effects.record import Y_SHARE, Effect, about, either, half, shape, strength

_NODE = (("cooling", ("water",)), ("variant", ("extended",)))
_INCROPERA = (
    "F. P. Incropera et al., Fundamentals of Heat and Mass Transfer, Wiley (cited by the paper)"
)

THERMAL: tuple[Effect, ...] = (
    Effect(
        name="ambient_drift",
        title="the air at the tubes warms or cools during a run",
        subsystem="thermal",
        places=("ambient_air", "heat_into_water"),
        equation="T_a(t) = T_a + r t + b t²; the RTD of the room shows the share s of the change",
        parameters=(
            strength("rate_K_s", "K/s", (-0.5, 0.02, 0.5), either(0.02), "rate r",
                     term="air_drift"),
            strength("bend_K_s2", "K/s²", (-0.01, 2e-4, 0.01), either(2e-4), "bend b",
                     term="air_bend"),
            shape("seen", "1", (0, 1, 1), about(1), "share s", term="air_seen"),
        ),
        signals=("ambient", "temperature", "displacement", "force"),
        confused_with=("reservoir_warming", "rtd_offset"),
        separated_by="rest isotherm before and after a run, a second thermometer at the tubes",
        reference="definition; a room changes as a whole, a draught passes its RTD by",
    ),
    Effect(
        name="cold_ends",
        title="wire ends at the crimps stay cold",
        subsystem="thermal",
        places=("recoverable_strain", "heat_into_wire"),
        equation="δ = (1 − s) δ(ξ, ξ_S) + s δ(1, ξ_S,cold), ξ_S,cold by Eq. (12);"
        " the crimps, as warm as the air, take q = G (T − T_a)",
        parameters=(
            strength("share", "1", (0, 0.08, 0.5), half(0.06), "share s", term="cold_ends"),
            strength("loss_W_K", "W/K", (0, 0.01, 0.1), half(0.01), "G", term="end_loss"),
            Y_SHARE,
        ),
        signals=("temperature", "displacement", "force"),
        confused_with=("temperature_spread", "tube_stiffness"),
        separated_by="slow against fast heating: cold ends stay, a spread closes",
        reference="A. Bhattacharyya et al., Smart Mater. Struct. 2002 (heat balance cited by the"
        " paper)",
    ),
    Effect(
        name="temperature_spread",
        title="temperature is not uniform along and across the wire",
        subsystem="thermal",
        places=("transformation_shift", "recoverable_strain"),
        equation="f(a) → ½ f(a) + ¼ [f(a − Δ) + f(a + Δ)], Δ = ΔT/(A_F − A_S)",
        parameters=(
            strength("spread_K", "K", (0, 2.5, 10), half(2), "half width ΔT", term="spread"),
            Y_SHARE,
        ),
        signals=("temperature", "displacement", "force"),
        confused_with=("cold_ends", "rtd_lag", "minor_loop"),
        separated_by="slow against fast heating: rounded corners sharpen when slow",
        reference="A. Bhattacharyya et al., Smart Mater. Struct. 2002 (heat balance cited by the"
        " paper)",
    ),
    Effect(
        name="cooling_front",
        title="the water cools the wire from its inlet on",
        subsystem="thermal",
        places=("heat_into_water", "reading_rtd"),
        equation="five cells along the tube, φ C_w′ dT_w,i/dt = h π d (T_i − T_w,i) − …"
        " − 5 (Qρc/L)(T_w,i − T_w,i−1); RTD: T_r = T + s (T_z − T), outflow: T_w + s (T_w,5 − T_w)",
        parameters=(
            strength("share", "1", (0, 0.8, 1), half(0.5), "share s of plug flow", term="front"),
            shape("place", "1", (0.02, 0.5, 1), about(0.5), "place z of the RTD", term="rtd_place"),
        ),
        signals=("temperature", "displacement", "force"),
        confused_with=("temperature_spread", "rtd_lag", "flow_shortfall"),
        separated_by="one short and one long pump pulse from the same temperature",
        reference="physics.md of this project; plug flow against a stirred tank",
        needs=_NODE,
        law=True,
    ),
    Effect(
        name="convection_exponent",
        title="film coefficient depends on the temperature difference in another way",
        subsystem="thermal",
        places=("film", "heat_into_water"),
        equation="h → h (|ΔT|/ΔT_0)^n;  UA′ → UA′ (|T_w − T_a|/ΔT_0)^m",
        parameters=(
            strength("exponent", "1", (-0.5, 0.2, 0.5), either(0.15), "n, wire to water",
                     term="film_exponent"),
            strength("loss_exponent", "1", (-0.5, 0.2, 2.0), either(0.15), "m, tube to air",
                     term="loss_exponent"),
            shape("reference_K", "K", (2, 10, 80), about(10), "ΔT_0 of n, no change",
                  term="film_reference"),
            shape("loss_reference_K", "K", (2, 10, 80), about(10), "ΔT_0 of m",
                  term="loss_reference"),
            Y_SHARE,
        ),
        signals=("temperature", "displacement", "force"),
        confused_with=("rtd_stem", "flow_shortfall", "driver_gain"),
        separated_by="a long cool-down from two temperatures",
        reference=_INCROPERA,
        law=True,
    ),
    Effect(
        name="thermal_crosstalk",
        title="heat passes from one spring to the other",
        subsystem="thermal",
        places=("heat_into_wire",),
        equation="q = G_x (T_other − T)",
        parameters=(
            strength("conductance_W_K", "W/K", (0, 0.02, 0.5), half(0.02), "G_x", term="crosstalk"),
        ),
        signals=("temperature", "displacement", "force"),
        confused_with=("valve_leak", "ambient_drift"),
        separated_by="heat one side only and watch the other at rest, dry",
        reference=_INCROPERA,
    ),
    Effect(
        name="tube_wall",
        title="the silicone tube stores heat",
        subsystem="thermal",
        places=("heat_into_water",),
        equation="κ C_w′ dT_t/dt = G_t (T_w − T_t), taken from the water",
        parameters=(
            strength("capacity_ratio", "1", (0, 0.5, 3), half(0.5), "κ: wall to water",
                     term="wall_ratio"),
            shape("conductance_W_mK", "W/(m K)", (0.05, 1.0, 10), about(1.0), "water to wall G_t",
                  term="wall_conductance"),
            Y_SHARE,
        ),
        signals=("temperature", "displacement", "force"),
        confused_with=("water_drainage", "reservoir_warming"),
        separated_by="two heating pulses with a short and a long pause",
        reference=_INCROPERA,
        needs=_NODE,
        law=True,
    ),
)  # fmt: skip
