"""When a filter doubts itself: averages of the likelihood, and what follows from them."""

import pytest

from mcloc.filters.recovery import Augmented, Evidence, NoRandomParticles, RandomParticles


def test_the_first_scan_starts_both_averages():
    assert Evidence().updated(0.4, (0.1, 0.01)) == Evidence(0.4, 0.4)


def test_averages_follow_at_their_rates():
    evidence = Evidence(0.5, 0.6).updated(0.1, (0.1, 0.01))
    assert evidence.fast == pytest.approx(0.5 - 0.1 * 0.4)
    assert evidence.slow == pytest.approx(0.6 - 0.01 * 0.5)


def test_averages_settle_on_a_steady_likelihood():
    evidence = Evidence(0.9, 0.9)
    for _ in range(1000):
        evidence = evidence.updated(0.3, NoRandomParticles().rates)
    assert (evidence.fast, evidence.slow) == pytest.approx((0.3, 0.3), abs=1e-4)


@pytest.mark.parametrize(
    ("recovery", "evidence", "alpha"),
    [
        (NoRandomParticles(), Evidence(0.01, 0.9), 0.0),
        (RandomParticles(share=0.07), Evidence(0.9, 0.9), 0.07),
        (RandomParticles(share=0.07), Evidence(), 0.07),
        (Augmented(below=1.0), Evidence(0.3, 0.4), 0.25),
        (Augmented(below=0.8), Evidence(0.2, 0.5), 0.5),
        (Augmented(below=0.8), Evidence(0.45, 0.5), 0.0),
        (Augmented(), Evidence(), 0.0),
        (Augmented(), Evidence(0.0, 0.5), 1.0),
    ],
)
def test_alpha(recovery, evidence, alpha):
    assert recovery.alpha(evidence) == pytest.approx(alpha)


@pytest.mark.parametrize("recovery", [NoRandomParticles, RandomParticles, Augmented])
def test_wheels_are_doubted_where_a_scan_is_explained_worse_than_usual(recovery):
    wary = recovery(doubt_below=0.8)
    assert wary.doubt(Evidence(0.5, 0.5), 0.45) == 0.0
    assert wary.doubt(Evidence(0.5, 0.5), 0.1) == pytest.approx(0.75)
    assert wary.doubt(Evidence(), 0.1) == 0.0
    assert recovery(doubt_below=0.0).doubt(Evidence(0.5, 0.5), 0.001) == 0.0
