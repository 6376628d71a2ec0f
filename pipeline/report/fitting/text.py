"""A fit as text, in the shape of lmfit's fit report."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any


def text(result: Mapping[str, Any]) -> str:
    """Return a fit as text in the shape of lmfit's fit report."""
    lines = ["[[Fit statistics]]"]
    if result["reason"]:
        lines.append(f"    could not estimate: {result['reason']}")
    else:
        lines += [
            "    # method             = generalised least squares on block means",
            f"    # values fitted      = {result['values_fitted']}",
            f"    # corrections        = {len(result['parameters'])}",
            f"    chi-square           = {result['chi_square']:.5g}",
            f"    reduced chi-square   = {result['reduced_chi_square']:.4g}",
            f"    condition index      = {result['condition_index']:.3g}",
        ]
        if result["std_inflation"] > 1.0:
            lines.append(f"    1-sigma times        = {result['std_inflation']:.3g}  (scatter above what was assumed)")
    lines.append("[[Corrections]]")
    for item in result["parameters"]:
        if not math.isfinite(item["value"]):
            lines.append(f"    {item['symbol']:<7} could not estimate")
            continue
        share = f" ({item['percent']:+.1f} % of {item['vehicle_value']:.5g})" if math.isfinite(item["percent"]) else ""
        lines += [
            f"    {item['symbol']:<7} {item['value']:+.4f} +/- {item['std']:.4f} {item['unit']}{share}",
            f"            with prior {item['value_with_prior']:+.4f} +/- {item['std_with_prior']:.4f}"
            f" (prior 0 +/- {item['prior_std']:.4g})",
            f"            {item['verdict']}",
        ]
    pairs = [
        (abs(result["correlation"][i][j]), a["symbol"], b["symbol"], result["correlation"][i][j])
        for i, a in enumerate(result["parameters"])
        for j, b in enumerate(result["parameters"])
        if i < j and result["correlation"]
    ]
    if pairs:
        lines.append("[[Correlations]]")
        lines += [f"    C({a}, {b}) = {value:+.4f}" for _size, a, b, value in sorted(pairs, reverse=True)]
    return "\n".join(lines) + "\n"
