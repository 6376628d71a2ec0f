"""Experiments: what would have to be flown so that two causes can be told apart, chosen by what it would bring.

Every candidate adds as many blocks as there are, flown otherwise; the expected difference in χ² between the causes,
from the information of old and new blocks together, says which is best.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import pandas as pd

from pipeline.report.compare import floats
from pipeline.report.fitting.evidence import Prior, information, separation
from pipeline.report.fitting.regression import Problem

#: An experiment tells where it moves χ² by this, 4-sigma; one that brings 5 % more is not worth more words.
TELLS, BETTER = 16.0, 1.05
#: 1-sigma of a speed by a sensor, m/s, and how much steeper or flatter, heavier or lighter is flown.
SENSOR_STD, STEEPER, HEAVIER = 0.01, 1.6, 2.0
#: Share of its voltage that a battery has left when it is run down.
RUN_DOWN = 0.9
#: Beyond this pitch, rad, flatter is flown rather than steeper.
STEEP = np.radians(32.0)

#: The correction that a true cause makes, that of its rival (None: nothing), and the change of the first.
Pair = tuple[str, str | None, float]
Observe = Callable[[pd.DataFrame, bool], Problem]


def experiment(blocks: pd.DataFrame, observe: Observe, known: Prior, pairs: Sequence[Pair], sensor: bool) -> str:
    """Return in words what would tell the pairs apart: the candidate that separates the worst of them most.

    Parameters
    ----------
    blocks
        What was flown.
    observe
        Gives what is observed in blocks, with a speed sensor or without.
    known
        The unknowns as stated.
    pairs
        What is to be told apart.
    sensor
        Whether a speed sensor is used already.
    """
    best, most = "", 0.0
    for words, flown, carried in candidates(blocks, sensor):
        problem = observe(flown, carried)
        if len(problem.model.names) > known.mean.size:
            continue  # it brings an unknown of its own
        names = sorted({name for pair in pairs for name in pair[:2] if name is not None})
        seen = information(problem, known, [problem.model.names.index(name) for name in names])
        worst = min(
            separation(seen, names.index(first), None if second is None else names.index(second), change)
            for first, second, change in pairs
        )
        if worst > BETTER * most:
            best, most = words, worst
    if most >= TELLS:
        return f"{best} would tell"
    return f"{best} would help, but not tell" if best else "no other dives of these would tell"


def candidates(blocks: pd.DataFrame, sensor: bool) -> list[tuple[str, pd.DataFrame, bool]]:
    """Return what could be flown or carried besides, in words and as blocks, the simplest first."""
    up, down = (bool((blocks["direction"] == side).any()) for side in (1, -1))
    out: list[tuple[str, Callable[[pd.DataFrame], pd.DataFrame]]] = []
    if up != down:
        out.append(("climbs flown like the dives" if down else "dives flown like the climbs", _turned))
    out.append(("the same flown again at twice the buoyancy", _heavier))
    out.append(("the same flown again at another pitch", _steeper))
    if blocks["powered"].any():
        out.append(("the same flown again with the propeller off", _unpowered))
        if blocks["battery_voltage"].notna().any():
            out.append(("the same flown again with the battery run down by a tenth of its voltage", _run_down))
    out.append(("the same flown again at twice the buoyancy and another pitch", lambda b: _steeper(_heavier(b))))
    more = [(words, _both(blocks, change(blocks.copy())), sensor) for words, change in out]
    if not sensor:
        speeds = {"sensor_speed": 0.0, "sensor_speed_std": SENSOR_STD}
        carried = blocks["sensor_speed"].notna().any()
        words = "the speed sensor that was held out (speed_sensor: use)" if carried else "a speed sensor"
        more.append((words, blocks.assign(**speeds), True))
    return more


def _turned(blocks: pd.DataFrame) -> pd.DataFrame:
    changed = {name: -floats(blocks, name) for name in ("pitch", "net_buoyancy", "battery_position")}
    return blocks.assign(**changed, direction=-blocks["direction"])


def _heavier(blocks: pd.DataFrame) -> pd.DataFrame:
    return blocks.assign(net_buoyancy=HEAVIER * floats(blocks, "net_buoyancy"))


def _steeper(blocks: pd.DataFrame) -> pd.DataFrame:
    pitch = floats(blocks, "pitch")
    return blocks.assign(pitch=pitch * (STEEPER if np.median(np.abs(pitch)) < STEEP else 1.0 / STEEPER))


def _unpowered(blocks: pd.DataFrame) -> pd.DataFrame:
    return blocks.assign(propeller_speed=0.0, propeller_power=0.0, powered=False)


def _run_down(blocks: pd.DataFrame) -> pd.DataFrame:
    return blocks.assign(battery_voltage=RUN_DOWN * floats(blocks, "battery_voltage"))


def _both(blocks: pd.DataFrame, new: pd.DataFrame) -> pd.DataFrame:
    """Return old and new blocks, the new ones a day after the old."""
    shift = blocks["end"].max() - blocks["start"].min() + pd.Timedelta(days=1)
    new = new.assign(start=new["start"] + shift, end=new["end"] + shift)
    return pd.concat([blocks, new], ignore_index=True)
