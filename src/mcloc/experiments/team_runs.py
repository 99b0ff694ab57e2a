"""The runs of E23: three robots that tell each other what they know in one way or another."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from mcloc.experiments import team_row as row
from mcloc.experiments.table import Record
from mcloc.experiments.team_wheels import followed
from mcloc.team.policy import TeamPolicy

ALONE, EVERY, WINDOW, TEMPERED, JOINT = (
    "alone", "every sighting", "window", "window, tempered", "joint",
)  # fmt: skip


@dataclass(frozen=True)
class InFull(TeamPolicy):
    """What two robots tell each other always counts in full, as in the paper."""

    def novelty(self, moved: float) -> float:
        return 1.0


POLICIES: Mapping[str, TeamPolicy | None] = {
    ALONE: None,
    EVERY: InFull(window=0.0),
    WINDOW: InFull(),
    TEMPERED: TeamPolicy(),
}


def on_row(method: str, seed: int) -> Record:
    """On the circle of cells."""
    seconds = row.lived(seed)
    beliefs = (
        row.joint(seconds, True)
        if method == JOINT
        else row.factored(seconds, True, POLICIES[method])
    )
    covered, error, surprise = [], [], []
    for second, belief in zip(seconds, beliefs, strict=True):
        for k in set(range(row.ROBOTS)) - {row.LEADER}:
            cell = second.cells[k]
            off = abs(int(belief[k].argmax()) - cell)
            covered.append(row.covered(belief[k], cell))
            error.append(row.CELL * min(off, row.CELLS - off))
            surprise.append(-float(np.log(max(belief[k, cell], np.finfo(float).tiny))))
    return {
        "missed": 1.0 - float(np.mean(covered)),
        "off": float(np.mean(error)),
        "nees": None,
        "surprise": float(np.mean(surprise)),
    }


def in_office(method: str, seed: int, leads: bool) -> Record:
    """By particles."""
    covered, nees, error = np.array(followed(seed, leads, POLICIES[method])).T
    return {
        "missed": float(1.0 - covered.mean()),
        "off": float(error.mean()),
        "nees": float(np.median(nees)),
        "surprise": None,
    }
