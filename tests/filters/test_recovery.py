"""When a filter doubts itself: averages of the likelihood, and what follows from them."""

import pytest

from mcloc.filters.recovery import (
    Augmented,
    Evidence,
    NoRandomParticles,
    RandomParticles,
    WithoutRandomParticles,
)

LONG = 1e6  # readings


def test_the_first_scan_starts_both_averages():
    assert Evidence().updated(0.4, 12.0, (0.1, 0.01)) == Evidence(0.4, 0.4, 12.0)


def test_averages_follow_at_their_rates():
    evidence = Evidence(0.5, 0.6, LONG).updated(0.1, 1.0, (0.1, 0.01))
    assert evidence.fast == pytest.approx(0.5 - 0.1 * 0.4)
    assert evidence.slow == pytest.approx(0.6 - 0.01 * 0.5)
    assert evidence.readings == LONG + 1.0


def test_many_readings_at_once_count_as_much_as_one_by_one():
    one = at_once = Evidence(0.5, 0.6, LONG)
    for _ in range(12):
        one = one.updated(0.1, 1.0, (0.05, 0.002))
    at_once = at_once.updated(0.1, 12.0, (0.05, 0.002))
    assert (one.fast, one.slow) == pytest.approx((at_once.fast, at_once.slow))


def test_averages_over_few_readings_are_their_mean():
    evidence = Evidence()
    for likelihood in (0.9, 0.3, 0.6):
        evidence = evidence.updated(likelihood, 3.0, (0.05, 0.002))
    assert (evidence.fast, evidence.slow) == pytest.approx((0.6, 0.6))


def test_averages_settle_on_a_steady_likelihood():
    evidence = Evidence(0.9, 0.9, LONG)
    for _ in range(1000):
        evidence = evidence.updated(0.3, 12.0, NoRandomParticles().rates)
    assert (evidence.fast, evidence.slow) == pytest.approx((0.3, 0.3), abs=1e-4)


def test_what_is_usual_is_learned_only_where_the_place_is_sure():
    lost = Evidence(0.8, 0.7, 600.0).updated(0.1, 12.0, (0.05, 0.002), sure=False)
    assert lost.fast < 0.6
    assert (lost.slow, lost.readings) == (0.7, 600.0)
    never = Evidence().updated(0.1, 12.0, (0.05, 0.002), sure=False)
    assert not never.known
    assert never.fast == never.slow == 0.1
    first = never.updated(0.8, 12.0, (0.05, 0.002))
    assert (first.fast, first.slow, first.readings) == pytest.approx((0.8, 0.8, 12.0))


def test_nothing_is_doubted_before_it_is_known_what_is_usual():
    unknown = Evidence(0.1, 0.5, 0.0)
    assert Augmented().alpha(unknown) == 0.0
    assert Augmented().doubt(unknown, 0.01) == 0.0


def test_a_recovery_without_its_random_particles():
    kept = WithoutRandomParticles(RandomParticles(share=0.3, doubt_below=0.8))
    seen = Evidence(0.5, 0.5, LONG)
    assert kept.alpha(seen) == 0.0
    assert kept.rates == RandomParticles().rates
    assert kept.doubt(seen, 0.1) == pytest.approx(0.75)


@pytest.mark.parametrize(
    ("recovery", "evidence", "alpha"),
    [
        (NoRandomParticles(), Evidence(0.01, 0.9, LONG), 0.0),
        (RandomParticles(share=0.07), Evidence(0.9, 0.9, LONG), 0.07),
        (RandomParticles(share=0.07), Evidence(), 0.07),
        (Augmented(below=1.0), Evidence(0.3, 0.4, LONG), 0.25),
        (Augmented(below=0.8), Evidence(0.2, 0.5, LONG), 0.5),
        (Augmented(below=0.8), Evidence(0.45, 0.5, LONG), 0.0),
        (Augmented(), Evidence(), 0.0),
        (Augmented(), Evidence(0.0, 0.5, LONG), 1.0),
    ],
)
def test_alpha(recovery, evidence, alpha):
    assert recovery.alpha(evidence) == pytest.approx(alpha)


@pytest.mark.parametrize("recovery", [NoRandomParticles, RandomParticles, Augmented])
def test_wheels_are_doubted_where_a_scan_is_explained_worse_than_usual(recovery):
    wary = recovery(doubt_below=0.8)
    assert wary.doubt(Evidence(0.5, 0.5, LONG), 0.45) == 0.0
    assert wary.doubt(Evidence(0.5, 0.5, LONG), 0.1) == pytest.approx(0.75)
    assert wary.doubt(Evidence(), 0.1) == 0.0
    assert recovery(doubt_below=0.0).doubt(Evidence(0.5, 0.5, LONG), 0.001) == 0.0
