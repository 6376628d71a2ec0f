"""What is printed wrong in Niu et al. (2017), doi:10.1007/s13344-017-0061-y; the derivations are in docs/errata.md."""

from __future__ import annotations

from typing import NamedTuple


class Erratum(NamedTuple):
    """An equation or number as printed, as it should be, and why."""

    where: str
    printed: str
    right: str
    why: str


ERRATA: tuple[Erratum, ...] = (
    Erratum("(1)", "−(1/m3)(m0g sin γ − D + T cos α)", "+(1/m3)(G sin γ − D + T cos α)", "contradicts (9); derivation"),
    Erratum("(1), (2) Δm", "m1 − m3", "m3 − m1", "the Munk moment is (m3 − m1) u w"),
    Erratum(
        "(1), (2) brackets",
        "no T; +m0g sin θ",
        "−G sin θ − L sin α + D cos α − T",
        "it is minus the force along the nose",
    ),
    Erratum(
        "(2), (10), (20)",
        "−L together with +T sin α",
        "G cos γ + L + T sin α",
        "lift and the normal part of the thrust point the same way; (10) leaves 3.31 N at the paper's own flight",
    ),
    Erratum("K'Le", "−u sin α", "+u sin α", "the nose is above the path by α, and thrust goes with it"),
    Erratum(
        "(21) B",
        "+2T[K_De cos α + K_Le sin α]",
        "−2T[K_De cos α − K_Le sin α]; with the other signs of the paper −2T[K_De cos α + K_Le sin α]",
        "as printed V_e = 0 at T = G = 7 N",
    ),
    Erratum("(22) against (20)", "opposite signs", "G cos γ = −K'Le V²", "follows from +L"),
    Erratum(
        "(4)", "+mgl cos θ", "−mgl cos θ if l is forward", "a weight ahead of the centre of buoyancy puts the nose down"
    ),
    Erratum("(5)–(7)", "K_Lα, K_Dα², K_Mα, K_Mq as single symbols", "K_L α, K_D α², K_M α, K_q q", "(13), (14)"),
    Erratum(
        "(8)",
        "n in rpm, D0 in mm",
        "n in rev/s, D0 in m",
        "thrust in newtons; D0 = 0.080 m then fits three printed pairs",
    ),
    Erratum("K_M, K_M0", "+313.8643, +0.7959", "both negative", "ε1 > 0, stability in pitch, and γ_e > 0 with α_e < 0"),
    Erratum(
        "(17)–(20)",
        "thrust frozen at u2e V²",
        "T = a + b V at constant propeller speed",
        "the slow eigenvalue of speed is −0.111 1/s frozen, −0.236 at constant thrust, −0.295 at constant speed n",
    ),
    Erratum("(30), (31), τ_s", "K_De mixed with K'De", "K'De throughout", "only then ε1 = 1.308e-3"),
    Erratum(
        "(26)–(28)",
        "“simplified from (24), (25)”",
        "(27) is only sufficient for (26); (25) is trivial",
        "algebra, with the right B",
    ),
    Erratum(
        "(28)",
        "d, l squared; l with α²; |d sin α − l cos α|",
        "d = K_De, l = K_L0 + K_L α; |d sin α + l cos α|",
        "7.5732 N comes out only without the squares; with physical signs there is no interior minimum in |α| ≤ 0.2",
    ),
    Erratum("ε2", "1.340e-3", "5.495e-2 with J2 = 12.3", "the printed value is that of J2 = 0.300"),
    Erratum(
        "(32)", "r1 + (1+V̄)²(r1+r2)", "1 + 2 r2 (1+V̄)²/r1", "boundary-layer Lyapunov function; A2 and A3 use it too"
    ),
    Erratum("φ (slow)", "(V̄+2) V̄² + …", "(V̄+2)² V̄² + …", "expansion of Φ'"),
    Erratum("H", "sin² + sin²", "at most sin(|ᾱ|/2 + |α_e|)", "a difference of cosines is of first order in ᾱ"),
    Erratum("β1 (main text)", "K'De(|ᾱ| + 2|α_e|)", "K_D(|ᾱ| + 2|α_e|)", "(A1)"),
    Erratum("c2, |β̄|", "“a”, β̄", "(1+V̄)², q̄", "context"),
    Erratum(
        "K1, K2",
        "“fit of Table 2”",
        "the line through (0.4, 0.45) and (1.5, 0)",
        "least squares on Table 2 gives 0.6076 and −0.4029",
    ),
    Erratum("γ_e", "1.339 rad", "1.332 rad", "one digit; 1.333 would round the value up"),
    Erratum("θ_e of the powered trials", "76.14°, 76.91°", "76.10°, 76.87°", "both fit α_e = −0.002528, not −K_M0/K_M"),
    Erratum("0.7939 to 0.8019 m/s", "|V̄| ≤ 0.2", "V_e (1 ± 0.005)", "arithmetic"),
    Erratum("31.28° to 90°", "|γ̄| ≤ 0.1", "|γ̄| ≤ π/4 about γ_e", "arithmetic; it is a range of γ, not of θ"),
)
