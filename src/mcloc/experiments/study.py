"""A study: factors, a function from one setting and seed to a record, claims, a picture.

A claim is written down with its prediction before the full run, and decided by a function of the
table alone: whatever comes out is its verdict.
"""

import itertools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING

from mcloc.evaluation.intervals import Interval
from mcloc.experiments.table import TOLD, Record, Setting, Table, Value

if TYPE_CHECKING:
    from matplotlib.figure import Figure


class Verdict(StrEnum):
    """What became of a claim."""

    REPRODUCED = "reproduced"
    IN_PART = "reproduced in part"
    NOT = "not reproduced"


@dataclass(frozen=True)
class Finding:
    """A verdict with the figure that decides it.

    what: the figure in words, with its unit. figure: its value with a 95 % interval. note: what
    else has to be known.
    """

    verdict: Verdict
    what: str
    figure: Interval
    note: str = ""


@dataclass(frozen=True)
class Claim:
    """What a paper says, and how it is decided whether that holds here.

    text: the claim. paper: the paper's figure for it. prediction: what is expected here, and the
    rule that decides. decide: the rule.
    """

    text: str
    paper: str
    prediction: str
    decide: Callable[[Table], Finding]


def nothing_missing(setting: Setting) -> str | None:
    """For studies that need no data."""
    return None


@dataclass(frozen=True)
class Study:
    """A study of a paper, or of a user.

    number: such as "E5". source: where in which paper. about: what is done, and why it is done so
    where the paper is silent (Markdown). factors: {name: values}, all combined. run: from a setting
    and a seed to what is measured, the same bytes each time unless it reads a clock.
    metrics: {name: what it is, with its unit}, those that are told in tables. seeds: of the full
    run; the same ones in all settings, so that these can be compared in pairs. applies: leaves out
    combinations. missing: what a setting lacks here, or None. pooled: {what it is: from the rows of
    a setting}, told beside the metrics. over: factors over which tables sum up, as over seeds.
    inputs: the files that runs read. base: what else all runs have in common, in words; runs of
    another base, of other files or by another mcloc are not mixed with these. command: that which
    runs it.
    """

    number: str
    title: str
    source: str
    about: str
    factors: Mapping[str, Sequence[Value]]
    run: Callable[[Setting, int], Record]
    metrics: Mapping[str, str]
    claims: tuple[Claim, ...]
    draw: "Callable[[Table, Figure], None]"
    seeds: int
    applies: Callable[[Setting], bool] = lambda setting: True
    missing: Callable[[Setting], str | None] = nothing_missing
    pooled: Mapping[str, Callable[[Table], str]] = field(default_factory=dict)
    over: tuple[str, ...] = ()
    inputs: Callable[[], Sequence[Path]] = tuple
    base: str = ""
    command: str = ""

    def __post_init__(self) -> None:
        # They are columns of one table.
        assert not set(self.factors) & {*self.metrics, *TOLD}
        assert not set(self.metrics) & set(TOLD)

    @property
    def folder(self) -> str:
        """The name of the folder of its results, such as e05."""
        return f"e{int(self.number[1:]):02d}" if self.number[1:].isdigit() else self.number

    def settings(self) -> list[Setting]:
        """All of them, also those for which something is missing here."""
        combined = itertools.product(*self.factors.values())
        settings = [dict(zip(self.factors, values, strict=True)) for values in combined]
        return [setting for setting in settings if self.applies(setting)]
