"""What a filter believes, as it is drawn."""

import numpy as np
import pytest
from matplotlib.collections import LineCollection, PathCollection
from matplotlib.figure import Figure
from matplotlib.patches import Ellipse, Wedge
from matplotlib.quiver import Quiver

from mcloc.draws import Draws
from mcloc.filters.catalog import Composition
from mcloc.filters.kalman import GaussianBelief
from mcloc.filters.particle_filter import ParticleBelief
from mcloc.particles import Particles
from mcloc.report.beliefs import draw_belief
from mcloc.simulation import office_drive


@pytest.fixture
def axes():
    return Figure().add_subplot()


def of(axes, kind):
    return [artist for artist in axes.get_children() if isinstance(artist, kind)]


def test_a_gaussian_is_its_ellipse_and_a_wedge_for_its_heading(axes):
    """2σ: 1 m along a direction at 30°, 0.4 m across, and 10° to each side of the heading."""
    turn = np.radians(30.0)
    along, across = np.array([np.cos(turn), np.sin(turn)]), np.array([-np.sin(turn), np.cos(turn)])
    covariance = np.zeros((3, 3))
    covariance[:2, :2] = 0.25 * np.outer(along, along) + 0.04 * np.outer(across, across)
    covariance[2, 2] = np.radians(5.0) ** 2
    draw_belief(axes, GaussianBelief(np.array([3.0, -2.0, np.radians(70.0)]), covariance))
    (ellipse,), (wedge,) = of(axes, Ellipse), of(axes, Wedge)
    assert ellipse.center == pytest.approx((3.0, -2.0))
    assert (ellipse.width, ellipse.height) == pytest.approx((2.0, 0.8))
    assert ellipse.angle % 180.0 == pytest.approx(30.0)
    assert (wedge.theta1, wedge.theta2) == pytest.approx((60.0, 80.0))


def test_particles_are_dots_the_heavier_on_top(axes):
    particles = Particles.normalized(np.arange(6.0).reshape(3, 2), np.log([0.9, 0.1]))
    draw_belief(axes, ParticleBelief(particles))
    (dots,) = of(axes, PathCollection)
    assert np.asarray(dots.get_offsets()) == pytest.approx(np.array([[1.0, 3.0], [0.0, 2.0]]))
    assert list(dots.get_sizes()) == sorted(dots.get_sizes())


def test_a_graph_has_its_regions_edges_and_likely_headings(axes):
    drive = office_drive(seed=1, length=5.0)
    robot = Composition("topological", settings={"filter": {"spacing": 0.5}}).build(drive.grid)
    bel = robot.start(robot.environment, Draws(1))
    scan = next(event for event in drive.events if hasattr(event, "ranges"))
    bel, _ = robot.step(bel, np.zeros(3), scan, Draws(1, 1))
    draw_belief(axes, bel)
    graph, mass = bel.states.places, bel.mass.reshape(len(bel.states.places), -1)
    (image,), (edges,), (arrows,) = (
        of(axes, type(axes.get_images()[0])),
        of(axes, LineCollection),
        of(axes, Quiver),
    )
    assert len(edges.get_segments()) == len(graph.edges)
    shown = image.get_array()
    best = mass.sum(axis=1).argmax()
    cells = graph.standing & (graph.nearest == best)
    assert np.ma.getdata(shown)[cells] == pytest.approx(mass[best].sum())
    assert np.ma.getmaskarray(shown)[~graph.standing].all()
    assert image.norm.vmax == pytest.approx(mass.sum(axis=1).max())
    node, k = np.nonzero(mass >= 0.02)
    looking = 2.0 * np.pi * (k + 0.5) / bel.states.headings - np.pi
    assert np.arctan2(arrows.V, arrows.U) == pytest.approx(looking)
    assert np.asarray(arrows.get_offsets()) == pytest.approx(graph.centres[node])
