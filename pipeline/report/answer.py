"""The answer in plain sentences: what the page leads with."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from pipeline.report.compare import SIGNIFICANT
from pipeline.report.fitting.account import told
from pipeline.report.fitting.selection import NOT_APART
from pipeline.report.propulsion import strength
from pipeline.report.rounding import amount, counted, in_words


def answer(summary: Mapping[str, Any]) -> dict[str, Any]:
    """Return the answer in one plain sentence, and what else a reader in a hurry must know."""
    known = [part for part in summary["parts"] if math.isfinite(part["measured_speed_m_s"])]
    known = [part for part in known if math.isfinite(part["held_speed_m_s"])]
    lead = max(known, key=strength, default=None)
    sentence = _no_answer(summary) if lead is None else _compared(lead)
    even = _even(summary["comparison"]["even_odd"])
    if even and lead is not None and not lead["powered"] and not _significant(lead) and _apart(even):
        sentence = f"{sentence.removesuffix('.')}. {_even_words(even)}"
        even = {}
    more = [_compared(part) for part in known if part is not lead]
    more += [note for part in summary["parts"] for note in part["notes"] if not note.startswith("No theory")]
    more += [
        f"{part['name'].capitalize()}: speed {part['measured_reason']}."
        for part in summary["parts"]
        if part["measured_reason"]
    ]
    more += [_even_words(even)] if even else []
    more += _sensor_words(summary["consistency"])
    if any(row["significant"] for row in summary["compatibility"]["quantities"]):
        more.append(f"Do the instruments agree? {summary['compatibility']['sentence']}")
    more += [summary["hypotheses"]["verdict"], _fit_words(summary["fit"]), *summary["stored_model"]["sentences"]]
    return {"sentence": sentence, "more": more}


def _no_answer(summary: Mapping[str, Any]) -> str:
    if not summary["blocks"]["total"]:
        return "Theory and measurement cannot be compared: the records hold no stretch of steady flight."
    reasons = [part["measured_reason"] or part["held_reason"] for part in summary["parts"]]
    reasons += [row["reason"] for row in summary["blocks"]["left_out"]]
    why = next((reason for reason in reasons if reason), "the net buoyancy of the blocks is not known")
    why = why.removeprefix("speed ")
    why = f"the speed is {why}" if why.startswith("unobservable") else why
    return f"Theory and measurement cannot be compared: {why}."


def _compared(part: Mapping[str, Any]) -> str:
    """Return one part's comparison as a sentence."""
    held = part["held_speed_m_s"]
    flown, flown_std, error, u = _as_flown(part)
    share = 100.0 * abs(error) / part["measured_speed_m_s"]
    way = "fast" if error > 0 else "slow"
    if _significant(part):
        verdict = f"{amount(100 * abs(error), 100 * u, sign=False)} cm/s ({share:.0f} %) too {way}"
    else:
        verdict = f"no significant difference (E = {amount(100 * error, 100 * u)} cm/s)"
    predicts = f"predicts {_speed(flown, flown_std)} m/s"
    if part["as_set"] and abs(held - flown) > 5e-4:
        as_set = _speed(held, part["held_speed_std_m_s"])
        predicts = f"predicts {as_set} m/s, as flown {_speed(flown, flown_std)}"
    measured = _speed(part["measured_speed_m_s"], part["measured_speed_std_m_s"])
    lacking = part["blocks_without_theory"]
    seen = lacking + len(part["measured_blocks"])
    if 2 * lacking >= seen:
        return (
            f"{part['name'].capitalize()}: measured {measured} m/s; theory with the measured pitch held has no steady "
            f"flight in {lacking} of {seen} blocks, with the net buoyancy and the pitch they had."
        )
    if lacking:
        verdict += f"; it has no steady flight in {lacking} of {seen} blocks, which are left out"
    words = (
        f"{part['name'].capitalize()}: measured {measured} m/s; theory with the measured pitch held {predicts}, "
        f"{verdict}"
    )
    if math.isfinite(part["free_speed_m_s"]):
        pitch = part["free_pitch_deg"]
        beyond = ", beyond the vertical" if abs(pitch) > 90.0 else ""
        free = _speed(part["free_speed_m_s"], part["free_speed_std_m_s"])
        words += f"; with the pitch left free it predicts {free} m/s at {pitch:.0f}°{beyond}"
    return words.replace("-", "−") + "."


def _as_flown(part: Mapping[str, Any]) -> tuple[float, float, float, float]:
    """Return theory's speed in the blocks as flown and its 1-sigma, E and u_val, m/s; as set where no block is."""
    flown, flown_std, error = part["as_flown_speed_m_s"], part["as_flown_speed_std_m_s"], part["error_m_s"]
    if math.isfinite(error):
        return flown, flown_std, error, part["u_val_m_s"]
    held, held_std = part["held_speed_m_s"], part["held_speed_std_m_s"]
    return held, held_std, held - part["measured_speed_m_s"], math.hypot(held_std, part["measured_speed_std_m_s"])


def _significant(part: Mapping[str, Any]) -> bool:
    _flown, _std, error, u = _as_flown(part)
    return bool(abs(error) > SIGNIFICANT * u)


def _speed(value: float, std: float) -> str:
    return amount(value, std, sign=False) if math.isfinite(std) else f"{value:.3f}"


def _even(rows: list[dict[str, Any]]) -> Mapping[str, Any]:
    """Return the even part of the kinematic speed's error where dives and climbs glided alike; empty where not."""
    wanted = (row for row in rows if row["trim"] == "pitch" and row["quantity"] == "speed" and not row["powered"])
    return next(wanted, {})


def _apart(even: Mapping[str, Any]) -> bool:
    return bool(abs(even["even"]) > SIGNIFICANT * even["even_u"])


def _even_words(even: Mapping[str, Any]) -> str:
    """Return what the even part of the speed's error says."""
    start = "Averaged over dive and climb, where ballast and moving water cancel, theory with the measured pitch held"
    if not _apart(even):
        return f"{start} does not differ significantly (E = {amount(even['even'], even['even_u'])} cm/s)."
    way = "fast" if even["even"] > 0 else "slow"
    return f"{start} is {amount(abs(even['even']), even['even_u'], sign=False)} cm/s too {way}: significant."


def _sensor_words(rows: list[dict[str, Any]]) -> list[str]:
    """Return how well each estimate meets a speed sensor that it has not seen."""
    words = [
        f"the {row['method']} estimate has a bias of {100 * row['sensor']['bias']:+.2f} cm/s and an RMSE of "
        f"{100 * row['sensor']['rmse']:.2f} cm/s, and its 95 % interval covers {100 * row['sensor']['coverage95']:.0f} "
        f"% of {row['sensor']['n']} instants".replace("-", "−")
        for row in rows
        if row["sensor"]
    ]
    return [f"Against the speed sensor, which was held out, {'; '.join(words)}."] if words else []


def _fit_words(fitted: Mapping[str, Any]) -> str:
    """Return what the fit says, as a sentence."""
    if fitted["reason"]:
        return f"No correction is fitted: {fitted['reason']}."
    entangled = [item for item in fitted["parameters"] if item["verdict"].startswith(NOT_APART)]
    words = [
        f"{in_words(item) if told(item['std'], item['prior_std']) else item['symbol']}, {item['verdict']}"
        for item in fitted["parameters"]
        if item not in entangled
    ]
    if entangled:
        names = " and ".join(item["symbol"] for item in entangled)
        words.append(f"{names} cannot be told apart: {entangled[0]['verdict'].partition('; ')[2]}")
    sentence = f"Fitted to {counted(fitted['blocks'], 'block')}: {'; '.join(words)}."
    for item in fitted["parameters"]:
        others = [
            row["symbol"]
            for row in fitted["selection"]["rejected"]
            if row["why"].startswith(NOT_APART) and row["correlated_with"] == item["symbol"]
        ]
        if others and abs(item["value"]) > SIGNIFICANT * item["std"]:
            held = f"{' and '.join(others)}, which {'are' if len(others) > 1 else 'is'} held within what is stated"
            sentence += f" {item['symbol']} cannot be told apart from {held}: it may be either."
    strained = [item for item in fitted["borrowed"] if item["verdict"] == "contradicts its prior"]
    if strained:
        pulls = ", ".join(f"{item['symbol']} by {abs(item['pull_std']):.1f}σ" for item in strained)
        sentence += f" It strains what it borrowed ({pulls}): the theory's shape does not fit these data."
    return sentence
