"""Candidate effects of the alloy's phases."""

from __future__ import annotations

from sim_device.plant.effects.record import Y_SHARE, Effect, EffectParameter, about, either, half

_MOVES = ("temperature", "displacement", "force")
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
            EffectParameter(
                name="kappa",
                term="minor_kappa",
                unit="1",
                low=-0.9,
                high=3,
                typical=0.8,
                prior=either(0.6),
                meaning="κ",
            ),
            EffectParameter(
                name="memory",
                term="minor_memory",
                unit="1",
                low=0,
                high=1,
                typical=0.5,
                prior=half(0.5),
                meaning="share m",
            ),
        ),
        signals=_MOVES,
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
        equation="A_S, A_F, M_S, M_F → … + s n;  δ_L → δ_L (1 − l n), n = ½ ∫|dξ|",
        parameters=(
            EffectParameter(
                name="shift_K",
                term="fatigue_shift",
                unit="K",
                low=-2,
                high=2,
                typical=-0.3,
                prior=either(0.2),
                meaning="shift s of a cycle",
            ),
            EffectParameter(
                name="shrink",
                term="fatigue_shrink",
                unit="1",
                low=0,
                high=0.05,
                typical=0.003,
                prior=half(0.003),
                meaning="loss l of a cycle",
            ),
            Y_SHARE,
        ),
        signals=_MOVES,
        confused_with=("ambient_drift", "residual_elongation", "minor_loop"),
        separated_by="the same cycle first and last",
        reference=_EGGELER,
    ),
    Effect(
        name="r_phase",
        title="an intermediate R-phase on cooling",
        subsystem="phase",
        places=("recoverable_strain", "resistance"),
        equation="austenite → R from M_S + a to M_S + a − w on cooling; δ += ε δ_L q, R += ρ q R0",
        parameters=(
            EffectParameter(
                name="strain",
                term="r_strain",
                unit="1",
                low=-0.5,
                high=0.5,
                typical=0.03,
                prior=either(0.03),
                meaning="ε, share of δ_L",
            ),
            EffectParameter(
                name="resistivity",
                term="r_resistivity",
                unit="1",
                low=-0.3,
                high=0.3,
                typical=0.08,
                prior=either(0.08),
                meaning="rise ρ of R",
            ),
            EffectParameter(
                name="above_K",
                term="r_above",
                unit="K",
                low=0,
                high=30,
                typical=8,
                prior=about(8),
                meaning="a, its start above M_S",
                zero=None,
            ),
            EffectParameter(
                name="width_K",
                term="r_width",
                unit="K",
                low=1,
                high=30,
                typical=6,
                prior=about(6),
                meaning="w, its width",
                zero=None,
            ),
        ),
        signals=("voltage", "temperature", "displacement", "force"),
        confused_with=("phase_resistivity", "minor_loop"),
        separated_by="slow cooling, voltage and displacement together",
        reference=_OTSUKA,
    ),
    Effect(
        name="unified_kinetics",
        title="one law for twinned and detwinned martensite, which remembers where it turned",
        subsystem="phase",
        places=("transformation_shift", "recoverable_strain"),
        equation="ξ from a = (T − A_S − τ/C_A)/(A_F − A_S) and c = (M_S + (τ − τ_0)/C_M − T)/(M_S"
        " − M_F),"
        " τ_0 at F0, on curves that mix f with a logistic one (share t), scaled to pass through"
        " earlier turns; of what forms or is there, 1 − f(b) is detwinned",
        parameters=(
            EffectParameter(
                name="on",
                term="unified",
                unit="1",
                low=0,
                high=1,
                typical=1,
                prior=half(1),
                meaning="this law instead of the paper's",
                switch=True,
            ),
            EffectParameter(
                name="tails",
                term="tails",
                unit="1",
                low=0,
                high=1,
                typical=0.5,
                prior=about(0.4),
                meaning="share t",
                zero=None,
            ),
        ),
        signals=_MOVES,
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
        equation="L → L [1 + λ (τ − τ_0)/100 MPa], τ_0 at F0",
        parameters=(
            EffectParameter(
                name="slope",
                term="latent_slope",
                unit="1",
                low=-1,
                high=3,
                typical=0.8,
                prior=either(0.6),
                meaning="λ per 100 MPa",
            ),
            Y_SHARE,
        ),
        signals=_MOVES,
        confused_with=("tube_wall",),
        separated_by="length of the transformation plateau at two preloads",
        reference=_OTSUKA,
    ),
)
