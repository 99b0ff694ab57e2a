"""What a filter believes, drawn onto a map in the way that its kind of belief asks for."""

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from mcloc.filters.filter import Belief
from mcloc.filters.grid_belief import GridBelief
from mcloc.filters.hierarchical.belief import HierarchicalBelief
from mcloc.filters.kalman import GaussianBelief
from mcloc.filters.octree import OctreeBelief
from mcloc.filters.place_belief import PlaceBelief
from mcloc.particles import Particles
from mcloc.report.masses import draw_masses

if TYPE_CHECKING:
    from matplotlib.axes import Axes

MOST_PARTICLES = 3000  # drawn
SIGMAS = 2.0  # of a Gaussian
LOOK = 1.5  # m, least length of what shows a heading
DECADES = 4.0  # below the likeliest place; less is not drawn
SHOWN_HEADING = 0.02  # of the belief: headings with less get no arrow
COLOUR, EDGE, REGION = "#e8590c", "0.45", "#0b7285"


def draw_belief(axes: "Axes", belief: Belief) -> None:
    """The belief after the last update."""
    if isinstance(belief, GaussianBelief):
        draw_gaussian(axes, belief.mean, belief.covariance)
    elif isinstance(belief, GridBelief | OctreeBelief):
        draw_masses(axes, belief)
    elif isinstance(belief, PlaceBelief):
        draw_graph(axes, belief)
    elif isinstance(belief, HierarchicalBelief):
        draw_particles(axes, belief.particles)
        draw_regions(axes, belief)
    else:
        draw_particles(axes, belief.particles)


def draw_particles(axes: "Axes", particles: Particles) -> None:
    """Dots, the heavier the brighter and larger."""
    every = -(-len(particles) // MOST_PARTICLES)
    x, y = particles.states[:2, ::every]
    relative = particles.weights[::every] / particles.weights.max()
    order = np.argsort(relative, kind="stable")
    axes.scatter(
        x[order],
        y[order],
        c=relative[order],
        s=3.0 + 9.0 * relative[order],
        cmap="autumn",
        vmin=0.0,
        vmax=1.0,
        linewidths=0.0,
        zorder=5,
        label="last particles (brighter: heavier)",
    )


def draw_gaussian(axes: "Axes", mean: NDArray[np.float64], covariance: NDArray[np.float64]) -> None:
    """The 2σ ellipse of the place, and a wedge over 2σ of the heading to each side."""
    from matplotlib.patches import Ellipse, Wedge

    squares, sides = np.linalg.eigh(covariance[:2, :2])
    minor, major = 2.0 * SIGMAS * np.sqrt(squares)
    turn = np.degrees(np.arctan2(sides[1, 1], sides[0, 1]))
    spread = np.degrees(min(SIGMAS * np.sqrt(covariance[2, 2]), np.pi))
    heading = np.degrees(mean[2])
    reach = max(LOOK, float(major))
    place = float(mean[0]), float(mean[1])
    wedge = Wedge(place, reach, heading - spread, heading + spread, alpha=0.6)
    ellipse = Ellipse(place, major, minor, angle=turn, alpha=0.6)
    for patch in (wedge, ellipse):
        patch.set(facecolor=COLOUR, edgecolor=COLOUR, lw=1.0, zorder=6)
        axes.add_patch(patch)
    ellipse.set_label("last belief, 2σ")


def draw_regions(axes: "Axes", belief: HierarchicalBelief) -> None:
    """The answers of a hierarchy from above, each smaller region in a darker frame, and how
    probable the smallest one is.
    """
    answers = list(belief.answers())
    for answer in answers[1:]:
        (x, y), (width, height) = answer.region.low[:2], answer.region.sides[:2]
        depth = answer.depth / answers[-1].depth
        edges = [x, x + width, x + width, x, x], [y, y, y + height, y + height, y]
        axes.plot(*edges, color=REGION, lw=0.5 + depth, alpha=0.2 + 0.8 * depth, zorder=6)
    last = answers[-1]
    axes.plot([], [], color=REGION, label=f"halved {last.depth} times: P = {last.probability:.2g}")


def draw_graph(axes: "Axes", belief: PlaceBelief) -> None:
    """The nodes of the map's graph, the redder the less likely, its edges, and an arrow for each
    likely range of headings.
    """
    from matplotlib.collections import LineCollection
    from matplotlib.colors import LogNorm
    from matplotlib.transforms import Affine2D

    places, headings = belief.states.places, belief.states.headings
    grid, mass = places.grid, belief.mass.reshape(-1, headings)
    of_node = mass.sum(axis=1)
    most = float(of_node.max())
    least = 10.0**-DECADES * most
    shown = np.ma.masked_where(~places.standing, of_node[places.nearest])
    height, width = grid.resolution * np.array(grid.cells.shape)
    x, y, yaw = grid.origin
    image = axes.imshow(
        np.ma.masked_less(shown, least),
        cmap="autumn",
        norm=LogNorm(least, most),
        origin="lower",
        extent=(0.0, width, 0.0, height),
        interpolation="none",
        alpha=0.6,
        zorder=1.5,
    )
    image.set_transform(Affine2D().rotate(yaw).translate(x, y) + axes.transData)
    lines = LineCollection(list(places.centres[places.edges]), colors=EDGE, lw=0.8, zorder=1.6)
    axes.add_collection(lines, autolim=False)
    axes.plot(*places.centres.T, ".", color=EDGE, ms=4.0, zorder=1.6, label="graph of the map")
    node, k = np.nonzero(mass >= SHOWN_HEADING)
    looking = 2.0 * np.pi * (k + 0.5) / headings - np.pi
    length = LOOK * (0.5 + 1.5 * mass[node, k])
    axes.quiver(
        *places.centres[node].T,
        length * np.cos(looking),
        length * np.sin(looking),
        angles="xy",
        scale_units="xy",
        scale=1.0,
        width=0.003,
        color=COLOUR,
        zorder=5,
        label="last belief (redder: less likely)",
    )
