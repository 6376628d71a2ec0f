"""A fit as text, in the shape of lmfit's fit report."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any


def text(result: Mapping[str, Any]) -> str:
    """Return a fit as text in the shape of lmfit's fit report, from the dict of `fit.fit`."""
    return "\n".join([*_statistics(result), *_corrections(result), *_correlations(result), *_choice(result)]) + "\n"


def _statistics(result: Mapping[str, Any]) -> list[str]:
    lines = ["[[Fit statistics]]"]
    if result["reason"]:
        return [*lines, f"    could not estimate: {result['reason']}"]
    lines += [
        "    # method             = generalised least squares on block means",
        f"    # compared with      = {', '.join(result['compared_with'])}",
        f"    # values fitted      = {result['values_fitted']}",
        f"    # corrections        = {len(result['parameters'])}",
        f"    chi-square           = {result['chi_square']:.5g}, with what is borrowed"
        f" {result['goodness']['chi_square']:.5g}",
        f"    reduced chi-square   = {result['goodness']['reduced']:.4g}",
        f"    Bayesian info crit   = {result['bic']:.5g}",
        f"    condition index      = {result['condition_index']:.3g}",
    ]
    if result["depth_rate_scatter"] > 1.0:
        lines.append(f"    depth rates scatter  = {result['depth_rate_scatter']:.3g} times as much as was assumed")
    if result["std_inflation"] > 1.0:
        lines.append(f"    1-sigma times        = {result['std_inflation']:.3g}  (scatter above what was assumed)")
    colour, robust = result["colour"], result["robust"]
    if colour["coloured"]:
        lines.append(
            f"    coloured residuals   = {result['blocks']} worth {colour['effective']:.0f}"
            f"  (Ljung-Box p = {colour['p_value']:.2g})"
        )
    if robust["sentence"]:
        lines.append(f"    robust loss          = {robust['sentence']}")
    return lines


def _corrections(result: Mapping[str, Any]) -> list[str]:
    lines = ["[[Corrections]]"]
    for item in result["parameters"]:
        if not math.isfinite(item["value"]):
            lines.append(f"    {item['symbol']:<7} could not estimate")
            continue
        share = f" ({item['percent']:+.1f} % of {item['vehicle_value']:.5g})" if math.isfinite(item["percent"]) else ""
        lines.append(f"    {item['symbol']:<7} {_number(item['value'], item['std'])} {item['unit']}{share}")
        low, high = (f"{end:+.4g}" if math.isfinite(end) else "open" for end in item["interval_95"])
        lines.append(f"            95 % interval {low} to {high}")
        if math.isfinite(item["bootstrap_std"]):
            lines.append(f"            bootstrap +/- {item['bootstrap_std']:.4g}")
        prior = f" (prior 0 +/- {item['prior_std']:.4g})" if math.isfinite(item["prior_std"]) else " (no prior)"
        lines += [
            f"            with prior {_number(item['value_with_prior'], item['std_with_prior'])}{prior}",
            f"            {item['verdict']}",
        ]
    return lines


def _correlations(result: Mapping[str, Any]) -> list[str]:
    pairs = [
        (abs(result["correlation"][i][j]), a["symbol"], b["symbol"], result["correlation"][i][j])
        for i, a in enumerate(result["parameters"])
        for j, b in enumerate(result["parameters"])
        if i < j and result["correlation"]
    ]
    if not pairs:
        return []
    return [
        "[[Correlations]]",
        *(f"    C({a}, {b}) = {value:+.4f}" for _size, a, b, value in sorted(pairs, reverse=True)),
    ]


def _choice(result: Mapping[str, Any]) -> list[str]:
    chosen = result["selection"]
    if not chosen["accepted"] and not chosen["rejected"]:
        return []
    lines = ["[[Chosen and rejected]]"]
    for item in chosen["accepted"]:
        lines.append(f"    {item['symbol']:<7} freed: Schwarz's criterion changes by {item['delta_bic']:+.1f}")
    return lines + [f"    {item['symbol']:<7} {item['why']}" for item in chosen["rejected"]]


def _number(value: float, std: float) -> str:
    """Return value ± 1-sigma with four decimals, or with four digits where the 1-sigma is far from one."""
    if 1e-3 <= std < 1e4:
        return f"{value:+.4f} +/- {std:.4f}"
    return f"{value:+.4g} +/- {std:.4g}"
