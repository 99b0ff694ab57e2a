"""p(o | zone) and p(zone′ | zone, u), averages of the models over zones: particles that only say in
which half they are  [Est §3, Fig. 3 b].
"""

from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mcloc.draws import Draws, Stream
from mcloc.filters.hierarchical.description import Models
from mcloc.filters.hierarchical.domain import Domain, evenly
from mcloc.filters.hierarchical.region import OUTSIDE, Region
from mcloc.particles import log_sum_exp
from mcloc.protocols import MotionModel, SensorModel
from mcloc.statespace import LogWeights, States, StateSpace

ZONE = StateSpace(("zone",), ("",), (False,))
"""0 and 1, the halves of a region."""

AVERAGING = Draws(0)  # the noise of moves over which is averaged: p depends on zones and u alone

MOVES = 16  # of each state

Chances = NDArray[np.float64]
"""(2, 2): of a zone, which is the matrix's column, given another."""


@dataclass(frozen=True)
class ZoneOnly:
    """Zone description: a particle is 0 or 1, for the half of its node's region, and knows of
    nothing outside. points: how many states, spread evenly, stand for a zone.
    """

    domain: Domain
    points: int = 64

    @property
    def space(self) -> StateSpace:
        """ZONE."""
        return ZONE

    def models(self, region: Region, axis: int, motion: MotionModel, sensor: SensorModel) -> Models:
        """Averages over the zones."""
        zones = self.zones(region, axis)
        return ZoneMotion(zones, motion), ZoneSensor(zones, sensor), zones

    @lru_cache(maxsize=1024)  # noqa: B019  as many nodes; what is kept of each are some kilobytes
    def zones(self, region: Region, axis: int) -> "Zones":
        """The halves of a node's region."""
        return Zones(self.domain, region, axis, self.points)

    def described(self, region: Region, axis: int, x: States) -> States:
        """(1, N): on which side of the middle each state is, be it in the region or not."""
        return _zones(x[axis] > region.centre[axis])

    def half(self, region: Region, axis: int, particles: States) -> NDArray[np.int8]:
        """(N,): what they say."""
        half: NDArray[np.int8] = particles[0].astype(np.int8)
        return half

    def states(self, region: Region, axis: int, particles: States) -> States:
        """(D, N): those that stand for the zones, one after the other."""
        chosen = _index(particles) * self.points + np.arange(particles.shape[1]) % self.points
        return np.take(self.zones(region, axis).states, chosen, axis=1)

    def near(self, region: Region, particles: States) -> NDArray[np.bool_]:
        """(N,): all of them."""
        return np.ones(particles.shape[1], dtype=np.bool_)

    def collected(self, region: Region, particles: States) -> States:
        """(1, N): themselves."""
        return particles


@dataclass(frozen=True, eq=False)
class Zones:
    """The halves of a region as an environment: U(zone), by how much of each is free."""

    domain: Domain
    region: Region
    axis: int
    points: int

    @cached_property
    def states(self) -> States:
        """(D, 2 K): the states that stand for the first half, then those for the second."""
        u = evenly(self.points, self.region.space.dimension)
        both = [self.domain.states(half, u) for half in self.region.halves(self.axis)]
        return np.concatenate(both, axis=1)

    @cached_property
    def uniform(self) -> NDArray[np.float64]:
        """(2,): U(zone); halves of which nothing is free are as likely as each other."""
        amounts = np.array([self.domain.amount(half) for half in self.region.halves(self.axis)])
        return amounts / amounts.sum() if amounts.any() else np.full(2, 0.5)

    @cached_property
    def log_weights(self) -> LogWeights:
        """(2, K): log p(x | m) of each."""
        return self.domain.environment.log_prior(self.states).reshape(2, -1)

    def averaged(self, log_values: LogWeights) -> LogWeights:
        """(2,): log of the mean of exp(log_values), (2 K,), over each zone, by p(x | m)."""
        values = log_values.reshape(2, -1)
        pairs = zip(self.log_weights, values, strict=True)
        return np.array([log_sum_exp(w + v) - log_sum_exp(w) for w, v in pairs])

    def sample(self, draws: Draws, first: int, n: int) -> States:
        """(1, n): the particles first … first + n − 1."""
        return _zones(draws.uniform(Stream.RANDOM_POSE, first, n)[0] >= self.uniform[0])

    def log_density(self, x: States) -> LogWeights:
        """(n,): log U(zone)."""
        with np.errstate(divide="ignore"):
            log_u: LogWeights = np.log(self.uniform)
        return log_u[_index(x)]

    def log_prior(self, x: States) -> LogWeights:
        """(n,): 0; how much of a zone is free is part of what is averaged."""
        return np.zeros(x.shape[1])


@dataclass(frozen=True, eq=False)
class ZoneMotion:
    """p(zone′ | zone, u) of moves that stay in the region, by moves that are always the same."""

    zones: Zones
    motion: MotionModel

    def chances(self, u: Any) -> Chances:
        """(2, 2): p(zone′ | zone, u), zones by row. Where no move stays in the region, the zone
        does.
        """
        zones = self.zones
        moved = self.motion.sample(np.tile(zones.states, MOVES), u, AVERAGING, 0)
        log_w = np.tile(zones.log_weights.ravel(), MOVES)
        weights = np.exp(log_w + zones.domain.environment.log_prior(moved))
        to = zones.region.which_half(moved, zones.axis).astype(np.intp)
        of = np.arange(len(to)) // zones.points % 2
        stays = to != OUTSIDE
        counts = np.bincount(2 * of[stays] + to[stays], weights[stays], 4)
        return _rows(counts.astype(np.float64).reshape(2, 2))

    def sample(self, x: States, u: Any, draws: Draws, first: int) -> States:
        """(1, n): a zone for each of x."""
        return _drawn(self.chances(u), x, draws, first)

    def log_density(self, x_new: States, u: Any, x: States) -> LogWeights:
        """(n,): log p(x_new | u, x)."""
        with np.errstate(divide="ignore"):
            log_p: LogWeights = np.log(self.chances(u))
        return log_p[_index(x), _index(x_new)]

    def sample_previous(self, x_new: States, u: Any, draws: Draws, first: int) -> States:
        """(1, n): the zone before, drawn from p(x_new | u, x) / π(x_new | u)."""
        return _drawn(_rows(self.chances(u).T), x_new, draws, first)

    def log_pi(self, x_new: States, u: Any) -> LogWeights:
        """(n,): log Σ p(x_new | u, x)."""
        with np.errstate(divide="ignore"):
            log_pi: LogWeights = np.log(self.chances(u).sum(axis=0))
        return log_pi[_index(x_new)]

    def doubted(self) -> "ZoneMotion":
        """That of moves that the wheels did not report."""
        return replace(self, motion=self.motion.doubted())


@dataclass(frozen=True, eq=False)
class ZoneSensor:
    """p(z | zone), the mean of p(z | x) over the zone."""

    zones: Zones
    sensor: SensorModel

    def log_likelihood(self, x: States, z: Any) -> LogWeights:
        """(n,): log p(z | zone)."""
        each = self.sensor.log_likelihood(self.zones.states, z)
        return self.zones.averaged(each)[_index(x)]

    def readings(self, z: Any) -> float:
        """Those of the sensor."""
        return self.sensor.readings(z)

    def beams(self, z: Any) -> int:
        """Those of the sensor."""
        return self.sensor.beams(z)

    def source(self, z: Any) -> str:
        """That of the sensor."""
        return self.sensor.source(z)

    def explained(self, x: States, z: Any) -> NDArray[np.float64]:
        """(n,): the share of the readings that the map explains, on average over the zone."""
        each = self.sensor.explained(self.zones.states, z).reshape(2, -1)
        share: NDArray[np.float64] = each.mean(axis=1)[_index(x)]
        return share


def _index(x: States) -> NDArray[np.intp]:
    """(n,): zones as whole numbers."""
    index: NDArray[np.intp] = x[0].astype(np.intp)
    return index


def _rows(counts: Chances) -> Chances:
    """Each row divided by its sum; a row of zeros is left where it is."""
    total = counts.sum(axis=1, keepdims=True)
    return np.where(total > 0.0, counts / np.where(total > 0.0, total, 1.0), np.eye(2))


def _drawn(p: Chances, x: States, draws: Draws, first: int) -> States:
    """(1, n): a zone for each of x, by the chances in its row."""
    chance = draws.uniform(Stream.MOTION, first, x.shape[1])[0]
    return _zones(chance >= p[_index(x), 0])


def _zones(second: NDArray[np.bool_]) -> States:
    """(1, n): 1 where it is the second half."""
    return second[None].astype(np.float64)
