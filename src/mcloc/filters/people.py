"""Readings that people cause are left out before a scan is weighed: people break the assumption
that scans are independent given the pose  [Fox, Burgard, Thrun: Markov localization for mobile
robots in dynamic environments, JAIR 11, 1999, §3.3].
"""

from abc import ABC, abstractmethod
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr

from mcloc.events import Scan
from mcloc.maps.occupancy import OccupancyGrid
from mcloc.maps.ray_caster import RayCaster
from mcloc.particles import Particles
from mcloc.protocols import PeopleFilter, Predictive
from mcloc.registry import Configurable, Registry, param
from mcloc.sensors.beam_presets import Fox01Beams


@dataclass(frozen=True)
class NoPeopleFilter(Configurable):
    """Leaves no reading out. It needs no map, but takes one like the others."""

    grid: OccupancyGrid | None = None

    def without_people(self, z: Any, predictive: Predictive) -> tuple[Any, float]:
        """z as it is."""
        return z, 0.0


@dataclass(frozen=True)
class _ScanFilter(Configurable, ABC):
    """Judges each return of a scan by the ranges that the belief lets expect of it.

    Left-out readings become NaN, which says nothing to any sensor model. Those that are no return
    stay: people do not cause them. So do returns of which no range is expected anywhere.
    """

    grid: OccupancyGrid
    particles: int = param(
        500, "", "particles of the predictive density to judge by", low=1, high=1e6
    )
    sigma_hit: float = param(
        0.2, "m", "deviation of returns from the expected range", low=1e-3, high=5
    )

    def without_people(self, z: Any, predictive: Predictive) -> tuple[Any, float]:
        """z without what people seem to have caused, and the share of its returns that this is;
        what is no scan stays as it is.
        """
        if not isinstance(z, Scan):
            return z, 0.0
        returns = np.flatnonzero(z.returned)
        if not len(returns):
            return z, 0.0
        bel = predictive(self.particles)
        expected = self._rays.ranges(bel.states, z.mount, z.angles[returns], z.range_max)
        people = self.caused_by_people(z.ranges[returns], expected, bel, z.range_max)
        ranges = z.ranges.copy()
        ranges[returns[people]] = np.nan
        return replace(z, ranges=ranges), float(people.mean())

    @abstractmethod
    def caused_by_people(
        self,
        readings: NDArray[np.float64],
        expected: NDArray[np.float64],
        bel: Particles,
        range_max: float,
    ) -> NDArray[np.bool_]:
        """(B,): which of the readings (B,) to leave out, given the ranges (N, B) that the N
        particles of the predictive density let expect: metres, inf for no wall nearer than
        range_max, NaN where it is unknown.
        """

    @cached_property
    def _rays(self) -> RayCaster:
        return RayCaster(self.grid, self.sigma_hit)


@dataclass(frozen=True)
class DistanceFilter(_ScanFilter):
    """Leaves a reading out if Σ_x p_short(z_k | x) Bel(x) > γ: people make readings shorter.

    p_short = ∫_{z > z_k} N(z; e(x), σ²) dz is the chance that the wall which the map lets expect at
    e(x) would have been measured farther away; 0 where nothing is known of a wall. While the belief
    is spread, some place explains nearly every reading, and nearly all of them stay.
    """

    gamma: float = param(
        0.99, "", "leave out what is shorter than expected with a chance above", low=0, high=1
    )

    def caused_by_people(
        self,
        readings: NDArray[np.float64],
        expected: NDArray[np.float64],
        bel: Particles,
        range_max: float,
    ) -> NDArray[np.bool_]:
        p_short = np.nan_to_num(ndtr((expected - readings) / self.sigma_hit), nan=0.0)
        chance = np.sum(bel.weights[:, None] * p_short, axis=0)
        people: NDArray[np.bool_] = chance > self.gamma
        return people


@dataclass(frozen=True)
class EntropyFilter(_ScanFilter):
    """Leaves a reading out if H(Bel(x | z_k)) > H(Bel(x)): only readings that confirm the belief
    count.

    The entropy is that of the belief over bins of poses, each reading taken by itself, with the
    beam model of Fox01. While the belief is spread, nearly every reading lessens it. A filter that
    is sure of a wrong place keeps itself sure of it.
    """

    bin_length: float = param(0.15, "m", "side of a bin in x and y", above=0, high=100)
    bin_angle: float = param(0.035, "rad", "side of a bin in θ", above=0, high=np.pi)

    def caused_by_people(
        self,
        readings: NDArray[np.float64],
        expected: NDArray[np.float64],
        bel: Particles,
        range_max: float,
    ) -> NDArray[np.bool_]:
        sides = np.array([self.bin_length, self.bin_length, self.bin_angle])
        bins = np.floor(bel.states / sides[:, None]).astype(np.int64)
        _, bin_of = np.unique(bins, axis=1, return_inverse=True)
        after = bel.weights[:, None] * self._model.density(
            readings, expected, self._model.reach(range_max)
        )
        after /= after.sum(axis=0)
        people: NDArray[np.bool_] = _entropy(after, bin_of) > _entropy(
            bel.weights[:, None], bin_of
        ) * (1.0 + 1e-9)
        return people

    @cached_property
    def _model(self) -> Fox01Beams:
        return Fox01Beams(self.grid, sigma_hit=self.sigma_hit)


def _entropy(weights: NDArray[np.float64], bin_of: NDArray[np.intp]) -> NDArray[np.float64]:
    """(B,): −Σ p log p over the bins, for each column of weights (N, B) that sum to 1."""
    order = np.argsort(bin_of, kind="stable")
    starts = np.flatnonzero(np.diff(bin_of[order], prepend=-1))
    p = np.add.reduceat(weights[order], starts, axis=0)
    entropy: NDArray[np.float64] = -np.sum(p * np.log(np.where(p > 0.0, p, 1.0)), axis=0)
    return entropy


PEOPLE: Registry[PeopleFilter] = Registry(
    "people", {"none": NoPeopleFilter, "distance": DistanceFilter, "entropy": EntropyFilter}
)
