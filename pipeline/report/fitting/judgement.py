"""The verdict on the reasons for a difference: what is left of those that were tried, in one or a few sentences."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from pipeline.report.fitting.causes import Cause
from pipeline.report.fitting.evidence import Posterior, Prior
from pipeline.report.fitting.experiment import Pair
from pipeline.report.rounding import in_words

NOTHING = "nothing"
#: Twice the logarithm of a ratio of probabilities that is called positive, strong, very strong.
POSITIVE, STRONG, VERY_STRONG = 2.0, 6.0, 10.0
#: What is moved by more than this many of its stated 1-sigma is strained, and by so many contradicted.
STRAINED, CONTRADICTED = 2.0, 3.0


@dataclass(frozen=True)
class Tried:
    """A cause that was put to the test.

    `free` has the cause's unknown left to the data; `ratio` is 2 ln of its probability over that of nothing.
    """

    cause: Cause
    column: int
    spread: float
    prior: Prior
    found: Posterior
    free: Posterior
    ratio: float


@dataclass(frozen=True)
class Judged:
    """The causes that are left, None for nothing; those that would not show: covered by what is stated, or unseen."""

    rows: list[dict[str, Any]]
    tried: Sequence[Tried]
    apart: Sequence[Tried] | None
    covered: Sequence[Tried]
    unseen: Sequence[Tried]
    pairs: Sequence[Pair]

    @property
    def hinted(self) -> list[Tried]:
        """The causes that are more probable than nothing, where that is too little to name one."""
        return [one for one in self.tried if one.ratio >= POSITIVE] if self.apart is None else []

    @property
    def told_apart(self) -> bool:
        """Whether one cause is left, or none and it would have been seen."""
        if self.apart is not None:
            return len(self.apart) == 1
        return not (self.covered or self.unseen or self.hinted)


def sentence(judged: Judged, what: str) -> str:
    """Return the verdict in words; `what` is the experiment that would tell."""
    if judged.apart is None:
        return _nothing(judged, what)
    best = next(row for row in judged.rows if row["name"] == judged.apart[0].cause.name)
    if len(judged.apart) > 1:
        names = _listed([one.cause.words for one in judged.apart], "and")
        words = f"{names} cannot be told apart from these data; {what}."
    else:
        words = f"{best['words']} explains how the blocks differ from theory: {in_words(best['parameters'][0])}."
    if not best["contradicted"]:
        return words
    most, *_ = best["contradicted"]
    strain = f"{in_words(most)}, {abs(most['value']) / most['size']:.1f} of its stated 1σ"
    return f"{words} Even so what is stated is strained: {strain}. It may be another reason, or the theory's shape."


def _nothing(judged: Judged, what: str) -> str:
    """Return the verdict in words where no cause is named."""
    moved = next(row["parameters"] for row in judged.rows if row["name"] == NOTHING)
    needed, cover = "No reason beyond what is stated is needed", "the 1σ of the vehicle and its instruments cover the"
    pull = abs(moved[0]["value"]) / moved[0]["size"] if moved else 0.0
    if pull > STRAINED:
        most = f"{in_words(moved[0])}, {pull:.1f} of its stated 1σ"
        words = f"{needed}, but what is stated is strained: {cover} difference only with {most}."
    elif moved:
        words = f"{needed}: {cover} difference; {in_words(moved[0])} moves most, {pull:.1f} of its stated 1σ."
    else:
        words = f"{needed}: {cover} difference."
    if judged.hinted:
        values = {row["name"]: f" ({in_words(row['parameters'][0])})" for row in judged.rows if row["parameters"]}
        names = _listed([one.cause.words + values.get(one.cause.name, "") for one in judged.hinted], "or")
        words += f" {names} is hinted at, too weakly to be told from nothing."
    covered, unseen = (
        [one.cause.words for one in group if one not in judged.hinted] for group in (judged.covered, judged.unseen)
    )
    if covered:
        names = _listed(covered, "or")
        words += f" {names} of ordinary size would lie within what is stated."
    if unseen:
        words += f" {_listed(unseen, 'or')} of ordinary size would not be seen in these data; {what}."
    elif judged.unseen:
        words += f" To be told from nothing: {what}."
    return words


def _lower(words: str) -> str:
    return words[0].lower() + words[1:]


def _listed(names: Sequence[str], word: str) -> str:
    """Return names as part of a sentence that begins with the first."""
    later = [_lower(name) for name in names[1:]]
    return names[0] if not later else " ".join([", ".join([names[0], *later[:-1]]), word, later[-1]])
