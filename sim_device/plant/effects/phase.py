"""Candidate effects of the alloy's phases."""

from __future__ import annotations

from sim_device.plant.effects.record import Y_SHARE, Effect, about, either, half, shape, strength

_OTSUKA = "K. Otsuka, X. Ren, Prog. Mater. Sci. 50 (2005) 511-678"
_EGGELER = "G. Eggeler et al., Mater. Sci. Eng. A 378 (2004) 24-33"

PHASE: tuple[Effect, ...] = (
    Effect(
        name="minor_loop",
        title="partial transformations follow another law",
        subsystem="phase",
        places=("transformation_shift", "recoverable_strain"),
        equation="ratios of Eqs (11), (13) raised to 1 + κ p, p the untransformed share when the"
        " leg began;"
        " a share m of the wire rests until the outer curve reaches its fraction",
        parameters=(
            strength("kappa", "1", (-0.9, 0.8, 3), either(0.6), "κ", term="minor_kappa"),
            strength("memory", "1", (0, 0.5, 1), half(0.5), "share m", term="minor_memory"),
            Y_SHARE,
        ),
        signals=("temperature", "displacement", "force"),
        confused_with=("temperature_spread", "transformation_fatigue"),
        separated_by="first-order reversal curves",
        reference="I. D. Mayergoyz, Mathematical Models of Hysteresis, Springer 1991",
        law=True,
    ),
    Effect(
        name="transformation_fatigue",
        title="transformation temperatures and strain change with each cycle",
        subsystem="phase",
        places=("transformation_shift", "recoverable_strain"),
        equation="A_S, A_F, M_S, M_F → … + s n;  δ_L → δ_L (1 − l n), n = ½ ∫|dξ|: some tens of"
        " cycles, since nothing levels off but δ_L at 0",
        parameters=(
            strength("shift_K", "K", (-2, -0.3, 2), either(0.2), "shift s of a cycle",
                     term="fatigue_shift"),
            strength("shrink", "1", (0, 0.003, 0.05), half(0.003), "loss l of a cycle",
                     term="fatigue_shrink"),
            Y_SHARE,
        ),
        signals=("temperature", "displacement", "force"),
        confused_with=("ambient_drift", "residual_elongation", "minor_loop"),
        separated_by="the same cycle first and last",
        reference=_EGGELER,
    ),
    Effect(
        name="r_phase",
        title="an intermediate R-phase on cooling",
        subsystem="phase",
        places=("recoverable_strain", "resistance"),
        equation="austenite → R from M_S + a to M_S + a − w on cooling, back 2 K above;"
        " δ += ε δ_L q, R += ρ q R0",
        parameters=(
            strength("strain", "1", (-0.5, 0.03, 0.5), either(0.03), "ε, share of δ_L",
                     term="r_strain"),
            strength("resistivity", "1", (-0.3, 0.08, 0.3), either(0.08), "rise ρ of R",
                     term="r_resistivity"),
            shape("above_K", "K", (0, 8, 30), about(8), "a, its start above M_S", term="r_above"),
            shape("width_K", "K", (1, 6, 30), about(6), "w, its width", term="r_width"),
            Y_SHARE,
        ),
        signals=("voltage", "temperature", "displacement", "force"),
        confused_with=("phase_resistivity", "minor_loop"),
        separated_by="slow cooling, voltage and displacement together",
        reference=_OTSUKA,
    ),
    Effect(
        name="unified_kinetics",
        title="one law for twinned and detwinned martensite, with memory of its turning points",
        subsystem="phase",
        places=("transformation_shift", "recoverable_strain"),
        equation="ξ from a = (T − A_S − τ/C_A)/(A_F − A_S) and c = (M_S + (τ − τ_0)/C_M − T)/(M_S"
        " − M_F),"
        " τ_0 at F0, on curves that mix f with a logistic one (share t), scaled to pass through"
        " earlier turns; of what forms or is there, 1 − f(b) is detwinned",
        parameters=(
            strength("on", "1", (0, 1, 1), half(1), "this law instead of the paper's",
                     term="unified", switch=True),
            shape("tails", "1", (0, 0.5, 1), about(0.4), "share t", term="tails"),
        ),
        signals=("temperature", "displacement", "force"),
        confused_with=("minor_loop",),
        separated_by="first-order reversal curves at two preloads",
        reference="D. C. Lagoudas et al., Int. J. Plasticity 32-33 (2012) 155-183; S. E. Zirka,"
        " Y. I. Moroz,"
        " IEEE Trans. Magn. 31 (1995) 3509-3511",
        law=True,
    ),
    Effect(
        name="stress_latent",
        title="latent heat depends on stress",
        subsystem="phase",
        places=("heat_into_wire",),
        equation="L → L [1 + λ (τ − τ_0)/100 MPa], at least 0, τ_0 at F0",
        parameters=(
            strength("slope", "1", (-1, 0.8, 3), either(0.6), "λ per 100 MPa", term="latent_slope"),
            Y_SHARE,
        ),
        signals=("temperature", "displacement", "force"),
        confused_with=("tube_wall",),
        separated_by="length of the transformation plateau at two preloads",
        reference=_OTSUKA,
    ),
)  # fmt: skip
