"""`--filter grid-proposal`: its weights are right, and it withholds what the paper withholds."""

import math
from dataclasses import replace

import numpy as np
import pytest

from mcloc.density import Gaussian
from mcloc.draws import Draws
from mcloc.errors import ConfigError
from mcloc.experiments import yee_world as yee
from mcloc.experiments.driving import EVERY_SCAN
from mcloc.filters.catalog import Composition
from mcloc.filters.grid_proposal import GridProposalBelief
from mcloc.geometry import between
from mcloc.localizer import Localizer
from mcloc.localizer.state import restore, save
from mcloc.particles import Particles
from mcloc.proposals.dual import LOOKING

ALPHA = 0.05
VAGUE = {**yee.SENSOR, "effective_beams": 4.0}  # so that samples all over the floor tell something
WITHHELD = "scan while the filter withheld its estimate"


def composed(particles, sensor=yee.SENSOR, **chosen):
    chosen = {"particles": particles, "alpha": ALPHA, "threshold": 0.2, "gain": 2.5, **chosen}
    return Composition(
        "grid-proposal", sensor="beam-yee", settings={"sensor": sensor, "filter": chosen}
    )


def mcl(particles, sensor=yee.SENSOR):
    """Its target, drawn from the dynamics alone."""
    settings = {
        "sensor": sensor,
        "size": {"particles": particles},
        "recovery": {"share": ALPHA, "doubt_below": 0.0},
    }
    return Composition("mcl", sensor="beam-yee", size="fixed", recovery="random", settings=settings)


@pytest.fixture(scope="module")
def drive():
    return yee.driven(0, 7)


@pytest.fixture(scope="module")
def carried():
    return yee.kidnapped(0, 7)


def moves(drive):
    """(scan, u) for each scan."""
    last = drive.events[0].odometry
    for scan in drive.events:
        yield scan, between(last, scan.odometry)
        last = scan.odometry


def moments(particles):
    """The means of x, y, cos θ, sin θ, and their standard errors as of an importance sample."""
    x, y, theta = particles.states
    w = particles.weights
    found = [(float(w @ f), f) for f in (x, y, np.cos(theta), np.sin(theta))]
    return np.array([(mean, math.sqrt(w**2 @ (f - mean) ** 2)) for mean, f in found]).T


def assert_alike(ours, theirs, told):
    """Within 4 standard errors: four figures of a right filter fail for 1 of 4,000 seeds. told: m,
    no standard error is above, or nothing would be tested.
    """
    (a, sa), (b, sb) = moments(ours), moments(theirs)
    assert np.hypot(sa, sb).max() < told
    assert (np.abs(a - b) < 4.0 * np.hypot(sa, sb)).all()


def around(pose, deviation, rng, n):
    states = np.asarray(pose)[:, None] + np.array(deviation)[:, None] * rng.standard_normal((3, n))
    return Particles.equal(states)


def belief_of(filter, particles, average, **changed):
    n = len(particles)
    return GridProposalBelief(
        particles,
        **{
            "kept": np.arange(n),
            "unknown": False,
            "settled": True,
            "renewed": np.zeros(n, dtype=bool),
            "average": average,
            **changed,
        },
    )


@pytest.mark.parametrize("nth", [0, 40])
def test_the_first_weights_are_p_z_p0_over_q(drive, nth):
    """Against samples all over the floor, weighed by p(z | x): the posterior of one scan, and its
    evidence.
    """
    n, scan = 200_000, drive.events[nth]
    filter = composed(n, VAGUE).build(drive.grid)
    bel, info = filter.step(filter.start(filter.environment, Draws(1)), None, scan, Draws(1, 1))
    states = filter.environment.sample(Draws(2), 0, 4 * n)
    log_p = filter.sensor.log_likelihood(states, scan)
    everywhere = Particles.normalized(states, log_p)
    assert_alike(bel.particles, everywhere, told=1.0)
    apart = 4.0 / math.sqrt(everywhere.ess) + 4.0 / math.sqrt(bel.particles.ess)
    assert info.log_evidence == pytest.approx(math.log(np.exp(log_p).mean()), abs=apart)
    assert not bel.unknown
    assert not bel.renewed.any()


def test_weights_are_those_of_equation_5(drive):
    """Each one, from the densities at the sample and at its ancestor."""
    n, phi = 4000, 0.3
    filter = composed(n, threshold=1.0, gain=phi, most=phi).build(drive.grid)
    *_, (_, _), (scan, u) = (pair for pair, _ in zip(moves(drive), range(6), strict=False))
    before = around(drive.truth.poses[4], (0.3, 0.3, 0.2), np.random.default_rng(0), n)
    bel = belief_of(filter, before, 0.0)
    assert filter.share_of_scan(bel) == phi
    draws = Draws(3, 4)
    after, _ = filter.step(bel, u, scan, draws)
    x = after.particles.states
    p_d = np.exp(filter.motion.log_density(x, u, before.states))
    p = (1.0 - ALPHA) * p_d + ALPHA * np.exp(filter.environment.log_density(x))
    found = filter.sampler.given(scan, draws.of_part(LOOKING))
    q = (1.0 - phi) * p + phi * np.exp(found.log_density(x))
    fit = filter.sensor.log_likelihood(x, scan) + filter.environment.log_prior(x)
    w = np.exp(fit - fit.max()) * p / q
    np.testing.assert_allclose(after.particles.weights, w / w.sum(), rtol=1e-9, atol=1e-300)
    assert np.mean(after.renewed) in (0.0, pytest.approx(phi, abs=4.0 * math.sqrt(0.21 / n)))


@pytest.mark.parametrize(("deviation", "told"), [((0.1, 0.1, 0.05), 0.02), ((1.5, 1.0, 0.5), 0.5)])
def test_one_step_has_the_posterior_of_mcl(drive, deviation, told):
    """Whatever φ is; the target holds α U, so that the scan's poses have a weight."""
    n = 30_000
    scan, u = list(moves(drive))[40]
    start = drive.truth.poses[39] + (0.2, -0.1, 0.05)
    ours = composed(n, VAGUE, threshold=1.0, gain=0.5, most=0.5).build(drive.grid)
    theirs = mcl(20 * n, VAGUE).build(drive.grid)
    density = Gaussian(start, np.diag(np.square(deviation)))
    bel = replace(ours.start(density, Draws(4)), average=0.0)
    assert ours.share_of_scan(bel) == 0.5
    one, info = ours.step(bel, u, scan, Draws(4, 1))
    other, reference = theirs.step(theirs.start(density, Draws(5)), u, scan, Draws(5, 1))
    assert_alike(one.particles, other.particles, told)
    apart = 4.0 / math.sqrt(one.particles.ess) + 4.0 / math.sqrt(other.particles.ess)
    assert info.log_evidence == pytest.approx(reference.log_evidence, abs=apart)


def test_a_run_has_the_posterior_of_a_large_mcl(drive):
    """Over ten scans from a vague start, with half of the samples drawn from each scan. Ancestors
    add to the errors, by not more than the weights did each time.
    """
    density = Gaussian(drive.truth.poses[0], np.diag([0.3, 0.3, 0.05]))
    found = []
    for composition in (composed(20_000, threshold=1.0, gain=9.0, most=0.5), mcl(100_000)):
        filter = composition.build(drive.grid)
        bel = filter.start(density, Draws(6))
        for step, (scan, u) in zip(range(1, 11), moves(drive), strict=False):
            bel, _ = filter.step(bel, u, scan, Draws(6, step))
        found.append(bel.particles)
    (a, sa), (b, sb) = map(moments, found)
    assert np.hypot(sa, sb).max() < 0.005
    assert (np.abs(a - b) < 4.0 * math.sqrt(10.0) * np.hypot(sa, sb)).all()


def test_phi_grows_as_the_average_falls():
    filter = composed(10, threshold=0.4, gain=2.0, most=0.5).build(yee.yee_world())
    bel = belief_of(filter, Particles.equal(np.zeros((3, 10))), 0.4)
    shares = [
        filter.share_of_scan(replace(bel, average=a)) for a in (0.9, 0.4, 0.3, 0.2, 0.15, 0.0)
    ]
    assert shares == pytest.approx([0.0, 0.0, 0.2, 0.4, 0.5, 0.5])
    assert filter.share_of_scan(replace(bel, unknown=True)) == 1.0


def test_the_average_follows_the_highest_likelihood_of_a_reading(drive):
    filter = composed(500, rate=0.3).build(drive.grid)
    bel = filter.start(filter.environment, Draws(0))
    average = None
    for step, (scan, u) in zip(range(1, 8), moves(drive), strict=False):
        bel, _ = filter.step(bel, u, scan, Draws(0, step))
        best = np.exp(filter.sensor.log_likelihood(bel.particles.states, scan).max() / yee.SONARS)
        average = best if average is None else 0.7 * average + 0.3 * best
        assert bel.average == pytest.approx(average)


def test_nothing_is_estimated_before_the_samples_are_a_cluster(drive):
    """The first of these scans may come from two rooms."""
    filter = composed(3000, collapsed=1.0).build(drive.grid)
    bel = filter.start(filter.environment, Draws(1))
    assert filter.hypotheses(bel) == ()
    spread = []
    for step, (scan, u) in zip(range(1, 15), moves(yee.driven(1, 3)), strict=False):
        bel, _ = filter.step(bel, u, scan, Draws(1, step))
        kept = bel.particles.states[:2, bel.kept]
        spread.append(math.hypot(*np.ptp(kept, axis=1)))
        assert bel.settled == (min(spread) < 1.0)
        assert (len(filter.hypotheses(bel)) > 0) == bel.settled
    assert bel.settled
    never = replace(filter, collapsed=1e-9)
    bel, _ = never.step(never.start(filter.environment, Draws(1)), None, scan, Draws(1, 1))
    assert never.hypotheses(bel) == ()


def test_samples_from_a_scan_do_not_count_until_all_are_a_cluster():
    filter = composed(20).build(yee.yee_world())
    here, there = np.array([[1.0, 7.0, 0.0]]).T, np.array([[10.0, 2.0, 1.0]]).T
    renewed = np.arange(20) >= 5
    particles = Particles.equal(np.where(renewed, there, here))
    bel = belief_of(filter, particles, 0.5, renewed=renewed)
    (only,) = filter.hypotheses(bel)
    np.testing.assert_allclose(only.mean, here[:, 0], atol=1e-9)
    assert only.share == pytest.approx(1.0)  # of those that count
    assert filter.hypotheses(replace(bel, renewed=np.ones(20, dtype=bool))) == ()
    assert filter.hypotheses(replace(bel, settled=False)) == ()
    weightless = np.where(renewed, np.log(1.0 / 15.0), -np.inf)
    assert (
        filter.hypotheses(replace(bel, particles=replace(particles, log_weights=weightless))) == ()
    )


def test_descendants_of_samples_from_a_scan_are_known_until_all_are_a_cluster(drive):
    """With a part of the samples from each scan, and a narrow idea of a cluster."""
    filter = composed(400, threshold=1.0, gain=0.5, collapsed=0.12).build(drive.grid)
    bel = filter.start(Gaussian(drive.truth.poses[0], np.diag([1e-2, 1e-2, 1e-3])), Draws(0))
    several = together = 0
    for step, (scan, u) in enumerate(moves(drive), 1):
        share, inherited = filter.share_of_scan(bel), bel.renewed[bel.kept]
        bel, _ = filter.step(bel, u, scan, Draws(0, step))
        kept = np.take(bel.particles.states[:2], bel.kept, axis=1)
        if math.hypot(*np.ptp(kept, axis=1)) < filter.collapsed:
            assert not bel.renewed.any()
            together += 1
        else:
            assert (bel.renewed >= inherited).all()
            chosen = (bel.renewed & ~inherited).sum() / (~inherited).sum()
            apart = 4.0 * math.sqrt(share * (1.0 - share) / (~inherited).sum())
            assert chosen == pytest.approx(share, abs=apart)
            several += 1
    assert min(several, together) > 5


def test_a_kidnapped_robot_is_found_by_a_hundred_samples(carried):
    """In 8 of 8 runs. MCL with the same random samples finds it in few."""
    at = len(yee.path(0)) // 2
    steps = list(moves(carried))[at - 5 : at + 30]
    density = Gaussian(carried.truth.poses[at - 5], np.diag([1e-2, 1e-2, 1e-3]))
    found = {}
    for composition in (composed(100), mcl(100)):
        filter = composition.build(carried.grid)
        found[composition.filter] = 0
        for seed in range(8):
            bel = filter.start(density, Draws(seed))
            for n, (scan, u) in enumerate(steps, at - 5):
                bel, _ = filter.step(bel, u, scan, Draws(seed, n))
                apart = [
                    np.hypot(*(h.mean - carried.truth.poses[n])[:2]) for h in filter.hypotheses(bel)
                ]
                assert n >= at or apart[0] < 0.5
            found[composition.filter] += apart[0] < 0.5
    assert found["grid-proposal"] == 8
    assert found["mcl"] < 5


def test_scans_without_an_estimate_are_counted(drive):
    events = drive.events[:40]
    localizer = Localizer(drive.grid, composed(200, collapsed=1e-9), seed=1, policy=EVERY_SCAN)
    assert list(localizer.run(events)) == []
    assert localizer.ignored == {WITHHELD: 40}
    localizer.process(events[0])  # late
    assert localizer.withheld == []
    told = Localizer(drive.grid, composed(200), seed=1, policy=EVERY_SCAN)
    estimates = list(told.run(events))
    assert len(estimates) + told.ignored[WITHHELD] == 40
    assert len(estimates) > 30


def test_the_scans_of_an_event_without_an_estimate_are_told(drive):
    """Two lasers: a scan waits for older ones of the other, and comes with it."""
    localizer = Localizer(drive.grid, composed(200, collapsed=1e-9), seed=1, policy=EVERY_SCAN)
    found = []
    for event in drive.events[:6]:
        for source in ("one", "other"):
            assert localizer.process(replace(event, source=source)) == []
            found += localizer.withheld
    localizer.finish()
    found += localizer.withheld
    assert [t for t, _ in found] == [event.t for event in drive.events[:6] for _ in range(2)]
    expected = [event.odometry for event in drive.events[:6] for _ in range(2)]
    assert np.array_equal([odometry for _, odometry in found], expected)
    assert localizer.ignored[WITHHELD] == 12


def test_a_seed_gives_the_same_with_any_number_of_threads(carried, set_threads):
    at = len(yee.path(0)) // 2
    found = []
    for threads, seed in ((1, 3), (2, 3), (1, 4)):
        set_threads(threads)
        localizer = Localizer(carried.grid, composed(20_000), seed=seed, policy=EVERY_SCAN)
        list(localizer.run(carried.events[at - 3 : at + 6]))
        found.append(localizer.belief)
    one, same, other = found
    assert np.array_equal(one.particles.states, same.particles.states)
    assert np.array_equal(one.particles.log_weights, same.particles.log_weights)
    assert not np.array_equal(one.particles.states, other.particles.states)


@pytest.mark.parametrize("when", [0, 5, 63])
def test_it_is_saved_and_goes_on_the_same(carried, tmp_path, when):
    """Before its first scan, while it tracks, and while it renews its samples."""
    whole = Localizer(carried.grid, composed(300), seed=3, policy=EVERY_SCAN)
    for event in carried.events[:when]:
        whole.process(event)
    if when == 63:
        assert whole.filter.share_of_scan(whole.belief) > 0.0
    save(whole, tmp_path / "state")
    again = restore(tmp_path / "state", carried.grid)
    rest = carried.events[when : when + 12]
    one, other = ([e.pose for e in x.run(rest)] for x in (whole, again))
    assert np.array_equal(one, other)
    for name in ("kept", "renewed"):
        assert np.array_equal(getattr(whole.belief, name), getattr(again.belief, name))
    assert again.belief.average == whole.belief.average


def test_another_map_keeps_the_samples(drive):
    localizer = Localizer(drive.grid, composed(200), seed=1, policy=EVERY_SCAN)
    list(localizer.run(drive.events[:10]))
    before = localizer.belief
    localizer.swap_map(yee.yee_world())
    assert localizer.belief.particles is before.particles
    assert localizer.belief.evidence == {}
    # Likelihoods on two maps do not compare: nothing is drawn because of those on the other one.
    assert localizer.belief.average == localizer.filter.threshold != before.average
    assert localizer.filter.share_of_scan(localizer.belief) == 0.0
    assert len(list(localizer.run(drive.events[10:20]))) == 10


@pytest.mark.parametrize(
    ("name", "value"), [("most", 1.0), ("alpha", 0.0), ("rate", 1.5), ("particles", 0)]
)
def test_values_that_cannot_be_right_are_refused(name, value):
    with pytest.raises(ConfigError, match=name):
        composed(**{"particles": 10, name: value}).build(yee.yee_world())
