"""Grid-based Markov localization: Bel(x) as a mass for each cell of a grid of poses  [Fox01
§19.2.5; Burgard, Fox, Hennig, Schmidt: AAAI 1996], with selective update [Fox, Burgard, Thrun: JAIR
11, 1999, §4.2].
"""

import itertools
import math
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mcloc.draws import Draws
from mcloc.errors import ConfigError, FilterError
from mcloc.estimate import BIN_ANGLE, BIN_LENGTH, Hypothesis, away, hypotheses
from mcloc.filters.filter import StepInfo
from mcloc.filters.grid_belief import GridBelief, shared
from mcloc.filters.grid_motion import moved
from mcloc.filters.models import Models
from mcloc.filters.recovery import LITTLE, Evidence, NoRandomParticles, Recovery
from mcloc.kernels.blur import scale
from mcloc.maps.pose_lattice import PoseLattice
from mcloc.motion.moments import moments_of_move
from mcloc.particles import log_sum_exp
from mcloc.protocols import Density, Environment, MotionModel, SensorModel
from mcloc.registry import Configurable, param
from mcloc.statespace import SE2
from mcloc.storage import Arrays

LOOKS = 1 << 13  # poses over which p(z | x) is averaged: log p̃ is known to about 1
STARTING = 1 << 18  # poses of a start that is not uniform


@dataclass(frozen=True)
class MarkovGridFilter:
    """Bel(x_t) ∝ p(z_t | x_t) ∫ p(x_t | u_t, x_{t−1}) Bel(x_{t−1}) dx_{t−1}, cell by cell.

    Prediction. See `grid_motion`: moves shift slices of the grid as a whole, noise blurs what is
    active. Motion models that know walls, or noise that depends on the place, are beyond it: it
    takes the moments of a move from anywhere. It knows no doubt in the wheels either.

    Measurement. A cell weighs p(z | x) p(x | m) of its middle, whatever the sensor model.

    Selective update. Cells with less than `active` times the probability of a uniform belief are
    passive: they keep their mass, shifted with their slice, where active ones are multiplied by p(z
    | x) / p̃(z), p̃ the average over the map, of LOOKS poses that are drawn anew for each scan. A
    robot that is not where the active cells are explains scans worse than the average: what is
    passive gains until it is active. For that no cell may be 0: `carried_off` is α of (1 − α) p_d +
    α U at each step, U over the whole grid.
    """

    lattice: PoseLattice
    motion: MotionModel
    sensor: SensorModel
    environment: Environment
    active: float = 1e-3
    carried_off: float = 1e-3
    recovery: Recovery = field(default_factory=NoRandomParticles)

    def start(self, initial: Density, draws: Draws) -> GridBelief:
        """The environment as its density in the middle of each cell, any other as a count of poses
        drawn from it: it may be narrower than a cell.
        """
        count, height, width = self.lattice.shape
        offsets, of_slice = np.zeros((count, 2)), height * width
        mass = np.empty((count, of_slice), dtype=np.float32)
        if initial is self.environment:
            for k in range(count):
                here = np.arange(k * of_slice, (k + 1) * of_slice)
                mass[k] = np.exp(initial.log_density(self.lattice.poses(here, offsets, 0.0)))
            if not mass.any():
                raise ConfigError(
                    f"{self.lattice.grid.name}: no cell of {self.lattice.cell:g} m has its middle "
                    "in free space; use a smaller filter.cell"
                )
        else:
            at = self.lattice.cells_of(initial.sample(draws, 0, STARTING), offsets, 0.0)
            mass.ravel()[:] = np.bincount(at[at >= 0], minlength=mass.size)
        if not mass.any():
            raise ConfigError(f"{self.lattice.grid.name}: the start lies nowhere on the map")
        return self._belief(mass)

    def step(self, bel: GridBelief, u: Any, z: Any, draws: Draws) -> tuple[GridBelief, StepInfo]:
        """The belief after moving by u and measuring z."""
        predicted, total = self.predicted(bel, u, draws)
        likelihood, log_evidence, weighed = self._measured(predicted, total, z, draws)
        evidence = dict(bel.evidence)
        after = replace(predicted, evidence=evidence)
        source, sure = self.sensor.source(z), away(after.particles, SE2) <= LITTLE
        now = evidence.get(source, Evidence()).updated(
            likelihood, self.sensor.readings(z), self.recovery.rates, sure
        )
        evidence[source] = now
        info = StepInfo(
            n=len(after.particles),
            ess=after.particles.ess,
            log_evidence=log_evidence,
            evidence=now,
            weighed=weighed,
            alpha=self.carried_off,
        )
        return after, info

    def predicted(self, bel: GridBelief, u: Any, draws: Draws) -> tuple[GridBelief, float]:
        """The belief after moving by u, and what is left of it on the grid."""
        bel = moved(bel, *moments_of_move(self.motion, u, draws))
        cells, alpha = bel.cells, self.carried_off
        totals = np.empty(cells.shape[:2])
        spread = np.float32(1.0 - alpha), np.float32(alpha / cells.size)
        shared(scale, len(cells), 0.5 * cells.size, cells, *spread, totals)
        return bel, float(totals.sum())

    def hypotheses(self, bel: GridBelief) -> tuple[Hypothesis, ...]:
        """The modes of the active cells, each of which is spread evenly over its own sides."""
        within = np.diag(self.lattice.sides**2 / 12.0)
        found = hypotheses(bel.particles, SE2)
        return tuple(replace(h, covariance=h.covariance + within) for h in found)

    def adopted(self, bel: GridBelief) -> GridBelief:
        """The active cells as they lie on this map, each as eight poses in it."""
        offsets, step = np.zeros((self.lattice.slices, 2)), self.lattice.sides[2]
        mass = np.zeros(self.lattice.size)
        for part in itertools.product((-0.25, 0.25), repeat=3):
            beside = bel.offsets + np.array(part[:2]), bel.turn + part[2] * step
            at = self.lattice.cells_of(bel.lattice.poses(bel.active, *beside), offsets, 0.0)
            mass += np.bincount(at[at >= 0], bel.particles.weights[at >= 0], len(mass))
        if not mass.any():
            raise FilterError("nothing of what was believed lies on the new map")
        return self._belief(mass)

    def packed(self, bel: GridBelief) -> tuple[dict[str, Any], Arrays]:
        """The belief but for its evidence, as what JSON knows and as arrays."""
        return {"turn": bel.turn}, {"cells": bel.cells, "offsets": bel.offsets}

    def unpacked(
        self, values: dict[str, Any], arrays: Arrays, evidence: dict[str, Evidence]
    ) -> GridBelief:
        """The belief that `packed` describes."""
        known = arrays["cells"], arrays["offsets"], values["turn"]
        return GridBelief(self.lattice, *known, self.active * self.lattice.uniform, evidence)

    def _belief(self, mass: NDArray[Any]) -> GridBelief:
        """Of cells that have not moved yet."""
        cells = (mass / mass.sum(dtype=np.float64)).astype(np.float32).reshape(self.lattice.shape)
        offsets, least = np.zeros((self.lattice.slices, 2)), self.active * self.lattice.uniform
        return GridBelief(self.lattice, cells, offsets, 0.0, least)

    def _measured(
        self, bel: GridBelief, total: float, z: Any, draws: Draws
    ) -> tuple[float, float, int]:
        """Weigh the cells of a belief, which nobody else has yet and which have this mass in all:
        the mean likelihood of one reading, log p(z | d_{0…t−1}), and how many poses were weighed.
        """
        cells, active = bel.cells.ravel(), bel.active
        mass = cells[active].astype(np.float64)
        passive = max(total - float(mass.sum()), 0.0)
        weight, likelihood = self._weights(bel, active, mass, z)
        log_average = self._log_average(z, draws)
        # In units of what the best active cell is multiplied by, if that is more than 1.
        weight -= log_average
        log_unit = max(float(weight.max()), 0.0)
        weight -= log_unit
        mass *= np.exp(weight, out=weight)
        total = float(mass.sum()) + passive * math.exp(-log_unit)
        if not 0.0 < total < math.inf:
            raise FilterError("no cell of the grid explains the scan at all")
        cells *= np.float32(math.exp(-log_unit) / total)
        mass /= total
        cells[active] = mass
        return likelihood, math.log(total) + log_unit + log_average, len(active) + LOOKS

    def _weights(
        self, bel: GridBelief, active: NDArray[np.intp], mass: NDArray[np.float64], z: Any
    ) -> tuple[NDArray[np.float64], float]:
        """(n,): log p(z | x) p(x | m) of the active cells, whose mass (n,) is given; and the mean
        likelihood of one reading, as of a particle filter.
        """
        readings, likelihood = self.sensor.readings(z), 0.0
        weight = np.empty(len(mass))
        for here, states in bel.middles(active):
            log_p = self.sensor.log_likelihood(states, z)
            weight[here] = log_p + self.environment.log_prior(states)
            likelihood += float((mass[here] * np.exp(log_p / readings)).sum())
        return weight, likelihood / float(mass.sum())

    def _log_average(self, z: Any, draws: Draws) -> float:
        """log p̃(z), the average of p(z | x) over the map."""
        anywhere = self.environment.sample(draws, 0, LOOKS)
        return log_sum_exp(self.sensor.log_likelihood(anywhere, z)) - math.log(LOOKS)


def most_bytes(lattice: PoseLattice) -> float:
    """What a step takes at most, with the belief before and after it and its hypotheses.

    All cells may be active at once, also those beyond the map: after a robot was carried off 99 %
    of them were, where 54 % were free. Measured with all of them active, 113 bytes a cell while it
    measures, and 93 a cell and 600 a bin of the histogram that hypotheses are the hills of.
    """
    bins = float(np.prod(lattice.sides)) / (BIN_LENGTH**2 * BIN_ANGLE)
    return lattice.size * max(115.0, 95.0 + 620.0 * min(bins, 1.0))


@dataclass(frozen=True)
class MarkovGrid(Configurable):
    """Grid-based Markov localization with selective update [Fox01 §19.2.5]: a mass for each cell of
    a grid of poses. It finds a robot anywhere, and after it was carried off, without samples.

    Beam models are quicker with ranges = table: a first scan took 0.17 instead of 0.8 s, a later
    one 8 instead of 17 ms.

    Of recovery it takes how fast the averages follow; it has no use for random particles and for
    doubt in the wheels, nor for size, resampler, people and sampler. A step takes up to 200 bytes
    for each cell of the whole map while the robot may be anywhere, 10 once it is localized. With
    cells that are wider it is up to 700, see `most_bytes`.
    """

    cell: float = param(0.2, "m", "side of a cell", low=0.01, high=10)
    headings: int = param(90, "", "slices of headings around the circle", low=4, high=1440)
    active: float = param(
        1e-3,
        "",
        "cells above this share of a uniform belief are updated; near 1 none of them would be",
        above=0,
        high=0.5,
    )
    carried_off: float = param(1e-3, "", "P(carried off since the last update)", above=0, high=0.99)
    memory: float = param(4000.0, "MB", "most memory of a step", above=0)

    def compose(self, models: Models) -> MarkovGridFilter:
        lattice = PoseLattice(models.grid, self.cell, self.headings)
        wanted = 1e-6 * most_bytes(lattice)
        if wanted > self.memory:
            raise ConfigError(
                f"{models.grid.name}: a grid of {lattice.size} poses takes {wanted:.0f} MB, more "
                f"than filter.memory = {self.memory:g} MB; use a larger filter.cell than "
                f"{self.cell:g} m, or fewer filter.headings than {self.headings}"
            )
        chosen = models.motion, models.sensor, models.environment
        return MarkovGridFilter(lattice, *chosen, self.active, self.carried_off, models.recovery)
