"""MCL with re-initialisation from a grid-based proposal  [Yee, Vermaak: A grid-based proposal for
efficient global localisation of mobile robots, ICASSP 2005].
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mcloc.draws import Draws, Stream
from mcloc.estimate import Hypothesis, away, hypotheses
from mcloc.events import Scan
from mcloc.events.measured import is_own
from mcloc.filters.filter import StepInfo
from mcloc.filters.models import Models
from mcloc.filters.recovery import LITTLE, Evidence, Recovery
from mcloc.particles import Particles, log_sums_exp
from mcloc.proposals.dual import LOOKING
from mcloc.proposals.predictive import log_mixture
from mcloc.proposals.target import Target
from mcloc.protocols import Density, Environment, Indices, MotionModel, PoseSampler, SensorModel
from mcloc.registry import Configurable, param
from mcloc.resampling import Systematic
from mcloc.samplers.fused import FusedSampler
from mcloc.samplers.grid_match import GridMatch
from mcloc.sensors.fused import Fused
from mcloc.statespace import SE2, LogWeights, States
from mcloc.storage import Arrays


@dataclass(frozen=True, eq=False)
class GridProposalBelief:
    """kept: (N,) the samples that resampling goes on with, which are their indices. unknown:
    whether no scan was used yet of a robot that may be anywhere. settled: whether the samples have
    been in a single cluster since. renewed: (N,) which samples descend from one that was drawn from
    a scan since they last were. average: the moving average of the maximum likelihood of a reading.
    """

    particles: Particles
    kept: Indices
    unknown: bool
    settled: bool
    renewed: NDArray[np.bool_]
    average: float
    evidence: Mapping[str, Evidence] = field(default_factory=dict)


@dataclass(frozen=True)
class GridProposalFilter:
    """q(x_t | x_{t−1}, u, z) = (1 − φ) p(x_t | x_{t−1}, u) + φ q(x_t | z) [Eq. 6], q(x | z) from
    the sampler, and weights

        w_t ∝ w_{t−1} p(z | x_t) p(x_t | x_{t−1}, u) / q(x_t | x_{t−1}, u, z)  [Eq. 5],

    in one group, under the dynamics (1 − α) p_d + α U [Eq. 1]. φ is 1 for the first scan of a robot
    that may be anywhere, where w = p(z | x) p₀(x) / q(x | z); then

        φ = clip(gain · (threshold − average), 0, most),

    average being the moving average of the maximum over the samples of p(z | x)^(1/readings).

    No pose is estimated before the samples are in a single cluster: before the diagonal of the
    rectangle around all of them, once resampled, is less than `collapsed` metres. Samples that
    descend from a re-initialisation are left out of the estimate until then.
    """

    motion: MotionModel
    sensor: SensorModel
    environment: Environment
    recovery: Recovery
    sampler: PoseSampler
    particles: int
    alpha: float
    threshold: float
    gain: float
    most: float
    rate: float
    collapsed: float

    def start(self, initial: Density, draws: Draws) -> GridProposalBelief:
        """Samples of the density; where it is the environment, the first scan draws others."""
        particles = Particles.equal(initial.sample(draws, 0, self.particles))
        every, unknown = np.arange(self.particles), initial is self.environment
        none = self._none_renewed
        return GridProposalBelief(particles, every, unknown, False, none, self.threshold)

    def step(
        self, bel: GridProposalBelief, u: Any, z: Any, draws: Draws
    ) -> tuple[GridProposalBelief, StepInfo]:
        """The belief after moving by u and measuring z."""
        drawn = self._initial(z, draws) if bel.unknown else self._moved(bel, u, z, draws)
        states, renewed, before = drawn
        log_p = self.sensor.log_likelihood(states, z)
        before = before + self.environment.log_prior(states)
        readings, source = self.sensor.readings(z), self.sensor.source(z)
        prior, total, of_one = log_sums_exp(before, log_p, 0.0, 1.0, 1.0 / readings)
        particles = Particles.normalized(states, before + log_p, total)
        kept = Systematic()(particles, self.particles, draws).of(0, self.particles)
        settled = bel.settled
        if math.hypot(*np.ptp(np.take(states[:2], kept, axis=1), axis=1)) < self.collapsed:
            settled, renewed = True, self._none_renewed
        average = bel.average
        if is_own(z):  # what others tell is no sign that the robot is lost
            highest = math.exp(float(log_p.max()) / readings)
            average = highest if bel.unknown else average + self.rate * (highest - average)
        evidence = bel.evidence.get(source, Evidence()).updated(
            math.exp(of_one - prior), readings, self.recovery.rates, away(particles, SE2) <= LITTLE
        )
        found = {**bel.evidence, source: evidence}
        info = StepInfo(
            n=self.particles,
            ess=particles.ess,
            log_evidence=total - math.log(self.particles),
            evidence=evidence,
            weighed=self.particles,
            alpha=self.alpha,
            sizes=(self.particles,),
        )
        return GridProposalBelief(particles, kept, False, settled, renewed, average, found), info

    def share_of_scan(self, bel: GridProposalBelief) -> float:
        """φ of the next step."""
        if bel.unknown:
            return 1.0
        return min(max(self.gain * (self.threshold - bel.average), 0.0), self.most)

    def hypotheses(self, bel: GridProposalBelief) -> tuple[Hypothesis, ...]:
        """The modes of the samples that count; none before the samples first were in a single
        cluster, and where none of them counts.
        """
        particles, counts = bel.particles, np.flatnonzero(~bel.renewed)
        if not bel.settled or not (particles.weights[counts] > 0.0).any():
            return ()
        states = np.take(particles.states, counts, axis=1)
        return hypotheses(Particles.normalized(states, particles.log_weights[counts]), SE2)

    def adopted(self, bel: GridProposalBelief) -> GridProposalBelief:
        """The same samples: they know no map. How well scans fit is learned anew."""
        return replace(bel, average=self.threshold, evidence={})

    def packed(self, bel: GridProposalBelief) -> tuple[dict[str, Any], Arrays]:
        """The belief but for its evidence, as what JSON knows and as arrays."""
        names = "unknown", "settled", "average"
        return {name: getattr(bel, name) for name in names}, {
            "states": bel.particles.states,
            "log_weights": bel.particles.log_weights,
            "kept": bel.kept,
            "renewed": bel.renewed,
        }

    def unpacked(
        self, values: dict[str, Any], arrays: Arrays, evidence: dict[str, Evidence]
    ) -> GridProposalBelief:
        """The belief that `packed` describes."""
        particles = Particles(arrays["states"], arrays["log_weights"])
        kept, renewed = arrays["kept"], arrays["renewed"]
        return GridProposalBelief(particles, kept, renewed=renewed, evidence=evidence, **values)

    @property
    def _none_renewed(self) -> NDArray[np.bool_]:
        return np.zeros(self.particles, dtype=np.bool_)

    def _initial(self, z: Any, draws: Draws) -> tuple[States, NDArray[np.bool_], LogWeights]:
        """Samples from the first scan, and p₀ / q of each."""
        found = self.sampler.given(z, draws.of_part(draws.part + LOOKING))
        states = found.sample(draws, 0, self.particles)
        before = self.environment.log_density(states) - found.log_density(states)
        return states, self._none_renewed, before

    def _moved(
        self, bel: GridProposalBelief, u: Any, z: Any, draws: Draws
    ) -> tuple[States, NDArray[np.bool_], LogWeights]:
        """Samples of Eq. 6, which of them descend from a scan, and p / q of each."""
        n, phi = self.particles, self.share_of_scan(bel)
        models = self.motion, self.sensor, self.environment
        target = Target(bel.particles, u, z, self.alpha, 0.0, *models)
        states, renewed = target.sample_predictive(bel.kept, draws, 0), bel.renewed[bel.kept]
        if phi == 0.0:
            return states, renewed, np.zeros(n)
        found = self.sampler.given(z, draws.of_part(draws.part + LOOKING))
        chosen = draws.uniform(Stream.PROPOSAL, 0, n)[0] < phi
        states = np.where(chosen, found.sample(draws, 0, n), states)
        old = np.take(bel.particles.states, bel.kept, axis=1)
        dynamics = log_mixture(
            self.alpha,
            self.motion.log_density(states, u, old),
            self.environment.log_density(states),
        )
        q = np.logaddexp(math.log1p(-phi) + dynamics, math.log(phi) + found.log_density(states))
        return states, renewed | chosen, dynamics - q


@dataclass(frozen=True)
class GridProposal(Configurable):
    """MCL with re-initialisation from a grid-based proposal [Yee]: where the scans fit badly, a
    share of the samples is drawn from the scan, by what it looks like from the points of a grid.

    It has its own sampler, `grid-match`, and its own number of particles. Of recovery it takes how
    fast the averages that are reported follow, not its random particles or doubt in the wheels; it
    has no use for size, resampler, people and sampler. While the samples are in several places it
    reports no pose.

    A threshold suits a sensor model. With the likelihood field the average of tracked robots was
    0.51 … 0.98 on recorded logs. Robots that were carried off now and then, 12 runs a log, were
    more than 1 m off for 9.7 and 5.4 % of the scans of intel and fhw, with 0.5 instead of 0.6 for
    11.1 and 6.6 %; tracked ones on wean-1, a corridor, for 1.1 % with either.
    """

    particles: int = param(1000, "", "particles", low=1, high=1e7)
    spacing: float = param(0.25, "m", "between the points of the grid", low=0.01, high=100)
    alpha: float = param(0.01, "", "uniform share of the dynamics", above=0, high=0.99)
    threshold: float = param(
        0.6,
        "",
        "average of the best likelihood of a reading, to draw from scans below",
        low=0,
        high=1,
    )
    gain: float = param(2.0, "", "share from the scan by how much it is below", above=0, high=1e6)
    most: float = param(0.5, "", "most share from the scan", above=0, high=0.99)
    rate: float = param(0.3, "", "rate of that average, per scan", above=0, high=1)
    collapsed: float = param(
        2.0,
        "m",
        "diagonal of the samples' rectangle below which a pose is reported",
        above=0,
        high=1e4,
    )

    def compose(self, models: Models) -> GridProposalFilter:
        chosen = models.motion, models.sensor, models.environment
        sampler = self._sampler(models)
        return GridProposalFilter(
            *chosen,
            models.recovery,
            sampler,
            self.particles,
            self.alpha,
            self.threshold,
            self.gain,
            self.most,
            self.rate,
            self.collapsed,
        )

    def _sampler(self, models: Models) -> PoseSampler:
        """Its own one for scans, and for all else the usual ones."""

        def of_scans(sensor: SensorModel) -> PoseSampler:
            return GridMatch(models.grid, sensor, models.environment, spacing=self.spacing)

        usual = models.sampler() if isinstance(models.sensor, Fused) else None
        if not isinstance(models.sensor, Fused) or not isinstance(usual, FusedSampler):
            return of_scans(models.sensor)
        if Scan not in models.sensor.models:
            return usual
        return FusedSampler({**usual.samplers, Scan: of_scans(models.sensor.models[Scan])})
