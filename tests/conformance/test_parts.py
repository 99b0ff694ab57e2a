"""What holds for every registered part, whatever it is called: run over the registries."""

import itertools
import json
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from mcloc.config import CHOICES
from mcloc.density import Gaussian
from mcloc.draws import Draws
from mcloc.environment import FreeSpace
from mcloc.errors import ConfigError
from mcloc.events import BeaconRanges, Detection, Image, Odometry, Scan, Sightings
from mcloc.filters.catalog import AIDS, FILTERS, REGISTRIES, Composition
from mcloc.filters.filter import StepInfo
from mcloc.filters.particle_filter import ParticleBelief
from mcloc.filters.recovery import Evidence
from mcloc.geometry import compose
from mcloc.kernels import jit
from mcloc.localizer import Localizer, Update
from mcloc.localizer.state import restore, save
from mcloc.maps.beacons import Beacons
from mcloc.maps.landmarks import Landmarks, open_floor
from mcloc.maps.mosaic import Mosaic
from mcloc.maps.occupancy import FREE, OCCUPIED, UNKNOWN, OccupancyGrid
from mcloc.maps.teammates import Teammates
from mcloc.particles import Particles
from mcloc.registry import parameters
from mcloc.sensors.messages import silence
from mcloc.statespace import SE2
from mcloc.team.detection import DetectionModel, message, to_seen, to_seer

ALL = [(kind, name) for kind, registry in CHOICES.items() for name in registry]
SETTABLE = [
    (kind, name, field.name) for kind, name in ALL for field in parameters(CHOICES[kind].get(name))
]
NUMERIC = [
    (kind, name, field.name)
    for kind, name in ALL
    for field in parameters(CHOICES[kind].get(name))
    if not isinstance(field.default, bool | str)
]


def field_of(kind, name, parameter):
    return {f.name: f for f in parameters(CHOICES[kind].get(name))}[parameter]


def grid():
    cells = np.random.default_rng(0).choice([FREE, FREE, FREE, OCCUPIED, UNKNOWN], (40, 50))
    return OccupancyGrid(cells.astype(np.int8), 0.1, np.array([-1.0, 2.0, 0.4]))


NEEDED = {
    ("size", "recorded"): {"file": str(Path(__file__).with_name("sizes.csv"))},
    ("size", "time-budget"): {"maximum": 2000},  # its minimum: what the clock says does not matter
    ("filter", "octree"): {"most": 1e-4},  # or it takes seconds
}
"""What some parts need to be built, and to do the same each time."""


def landmarks():
    return Landmarks.numbered([[0.0, 3.0], [2.0, 4.0], [3.0, 2.5]])


def beacons():
    return Beacons(["a", "b", "c"], np.array([[0.0, 3.0, 2.0], [2.0, 4.0, 0.5], [3.0, 2.5, 1.0]]))


BOUND = {
    **dict.fromkeys(("sensor", "environment", "people", "sampler"), grid),
    "sightings": landmarks,
    "camera": lambda: mosaic(),
    "ranging": beacons,
    "message": Teammates,
}
"""The maps that parts are built with."""


def build(kind, name, **settings):
    settings = {**NEEDED.get((kind, name), {}), **settings}
    bound = (BOUND[kind](),) if kind in BOUND else ()
    if kind == "sampler":
        bound += build("sensor", "likelihood-field"), build("environment", "free-space")
    return CHOICES[kind].make(name, *bound, **settings)


def names(kind):
    return pytest.mark.parametrize("name", list(CHOICES[kind]))


@pytest.fixture
def x():
    """(3, 200): poses on and off the map."""
    rng = np.random.default_rng(1)
    return np.stack(
        [rng.uniform(-4, 6, 200), rng.uniform(0, 9, 200), rng.uniform(-np.pi, np.pi, 200)]
    )


@pytest.fixture
def z():
    """A scan with every reading that is none."""
    ranges = np.random.default_rng(2).uniform(0.1, 5.0, 90)
    ranges[::9] = [np.nan, np.inf, -np.inf, 0.0, -2.0, 8.0, 81.9, np.nan, np.inf, 0.0]
    return Scan(0.0, ranges, np.linspace(-1.5, 1.5, 90), 8.0, np.array([0.2, 0.0, 0.1]))


@pytest.fixture
def set_threads():
    before = jit._threads
    yield jit.set_threads
    jit.set_threads(before)


# Parameters


@pytest.mark.parametrize(("kind", "name"), ALL)
def test_every_part_has_a_docstring_and_valid_defaults(kind, name):
    cls = CHOICES[kind].get(name)
    assert cls.__doc__
    assert not cls.__doc__.startswith(cls.__name__ + "(")  # a dataclass's own
    part = build(kind, name)
    for field in parameters(cls):
        given = NEEDED.get((kind, name), {})
        assert getattr(part, field.name) == given.get(field.name, field.default)
        assert type(getattr(part, field.name)) is type(field.default)


@pytest.mark.parametrize(("kind", "name", "parameter"), SETTABLE)
def test_every_parameter_has_a_unit_and_says_what_it_is(kind, name, parameter):
    field = field_of(kind, name, parameter)
    assert field.metadata["doc"].strip()
    assert field.metadata["unit"] in {
        "",
        "m",
        "MB",
        "rad",
        "s",
        "m/m",
        "rad/m",
        "m/rad",
        "rad/rad",
        "1/m",
        "1/reading",
    }


def wrong_values(field):
    limits = field.metadata
    yield from (np.nan, np.inf, "many", None)
    if np.isfinite(limits["low"]):
        yield limits["low"] - 1
    if np.isfinite(limits["above"]):
        yield limits["above"]
        yield limits["above"] - 1
    if np.isfinite(limits["high"]):
        yield limits["high"] * 2 + 1


@pytest.mark.parametrize(("kind", "name", "parameter"), NUMERIC)
def test_a_wrong_value_is_refused_by_name_and_range(kind, name, parameter):
    field = field_of(kind, name, parameter)
    finite = [
        v for k, v in field.metadata.items() if k in ("low", "high", "above") and np.isfinite(v)
    ]
    assert finite, "a parameter without any limit can be anything"
    for value in wrong_values(field):
        with pytest.raises(ConfigError) as raised:
            build(kind, name, **{parameter: value})
        message = str(raised.value)
        assert f".{parameter}" in message
        assert "\n" not in message
        if isinstance(value, float | int) and np.isfinite(value):
            assert any(f"{limit:g}" in message for limit in finite)


@pytest.mark.parametrize(("kind", "name"), ALL)
def test_an_unknown_parameter_is_refused_with_those_there_are(kind, name):
    with pytest.raises(ConfigError, match="'no_such_thing'"):
        build(kind, name, no_such_thing=1.0)


@pytest.mark.parametrize("kind", CHOICES)
def test_an_unknown_name_is_refused_with_those_there_are(kind):
    with pytest.raises(ConfigError) as raised:
        CHOICES[kind].get("no such part")
    assert all(name in str(raised.value) for name in CHOICES[kind])


# Motion models


MOVES = [
    np.array([0.5, 0.1, 0.3]),
    np.array([-0.4, 0.0, 0.0]),
    np.array([0.0, 0.0, -2.0]),
    np.zeros(3),
]


@names("motion")
@pytest.mark.parametrize("u", MOVES, ids=str)
def test_motion_shapes_and_values(name, u, x):
    motion = build("motion", name)
    for moved in (motion.sample(x, u, Draws(1), 0), motion.sample_previous(x, u, Draws(1), 0)):
        assert moved.shape == x.shape
        assert np.isfinite(moved).all()
        assert (np.abs(moved[2]) <= np.pi).all()
    log_p = motion.log_density(motion.sample(x, u, Draws(1), 0), u, x)
    assert log_p.shape == (200,)
    assert np.isfinite(log_p).all()
    far = motion.log_density(x + 100.0, u, x)
    assert not np.isnan(far).any()
    assert not (far == np.inf).any()
    assert motion.log_pi(x, u).shape == (200,)
    assert type(motion.doubted().doubted()) is type(motion)


@names("motion")
@pytest.mark.parametrize("way", ["sample", "sample_previous"])
def test_motion_does_not_depend_on_chunks(name, way, x):
    move = getattr(build("motion", name), way)
    whole = move(x, MOVES[0], Draws(3, 2, 1), 40)
    parts = [
        move(np.ascontiguousarray(x[:, a:b]), MOVES[0], Draws(3, 2, 1), 40 + a)
        for a, b in ((0, 1), (1, 77), (77, 200))
    ]
    assert np.array_equal(whole, np.concatenate(parts, axis=1))


@names("motion")
def test_motion_leaves_its_input_alone(name, x):
    before = x.copy()
    build("motion", name).sample(x, MOVES[0], Draws(1), 0)
    assert np.array_equal(x, before)


@names("motion")
def test_steps_and_seeds_move_differently(name, x):
    motion = build("motion", name)
    found = [
        motion.sample(x, MOVES[0], d, 0) for d in (Draws(1), Draws(2), Draws(1, 1), Draws(1, 0, 1))
    ]
    for k, a in enumerate(found):
        assert not any((a == b).any() for b in found[k + 1 :])


# Sensor models


@names("sensor")
def test_a_sensor_gives_a_number_or_minus_infinity(name, x, z):
    sensor = build("sensor", name)
    log_p = sensor.log_likelihood(x, z)
    assert log_p.shape == (200,)
    assert not np.isnan(log_p).any()
    assert (log_p < np.inf).all()
    assert np.ptp(log_p[np.isfinite(log_p)]) > 0.0
    assert sensor.readings(z) > 0.0
    assert sensor.beams(z) == 60


@names("sensor")
def test_a_sensor_does_not_depend_on_chunks_or_order(name, x, z):
    sensor = build("sensor", name)
    whole = sensor.log_likelihood(x, z)
    parts = [
        sensor.log_likelihood(np.ascontiguousarray(x[:, a:b]), z) for a, b in ((0, 3), (3, 200))
    ]
    assert np.array_equal(whole, np.concatenate(parts))
    order = np.random.default_rng(3).permutation(200)
    shuffled = sensor.log_likelihood(np.ascontiguousarray(x[:, order]), z)
    assert np.array_equal(whole[order], shuffled)


# Ceiling cameras


def mosaic():
    image = np.random.default_rng(6).random((50, 60)).astype(np.float32)
    image[20:30, 40:50] = np.nan
    return Mosaic(image, 0.1, np.array([-1.0, 2.0, 0.4]))


def images():
    """One of a ceiling, and what people make of the lens."""
    seen = np.random.default_rng(7).random((15, 15))
    cut = np.where(np.arange(15) < 7, np.nan, seen)
    return [Image(0.0, pixels) for pixels in (seen, np.zeros((15, 15)), np.ones((15, 15)), cut)]


@names("camera")
def test_a_camera_gives_numbers_whatever_it_sees_and_in_any_chunks(name, x):
    camera = build("camera", name)
    for z in images():
        log_p = camera.log_likelihood(x, z)
        assert log_p.shape == (200,)
        assert np.isfinite(log_p).all()
        assert camera.readings(z) > 0.0
        assert camera.beams(z) >= 1
        assert (np.ptp(log_p) == 0.0) == camera.covered(z)
        assert np.isnan(camera.explained(x, z)).all() == camera.covered(z)
        parts = [
            camera.log_likelihood(np.ascontiguousarray(x[:, a:b]), z) for a, b in ((0, 3), (3, 200))
        ]
        assert np.array_equal(log_p, np.concatenate(parts))
    assert [camera.covered(z) for z in images()][:2] == [False, True]


@names("camera")
def test_no_pose_is_too_odd_for_a_camera(name):
    odd = [np.nan, np.inf, -np.inf, 1e300, -1e300, 1e18, 1e5, -1e5, 0.0, np.pi, -np.pi, 7.0]
    x = np.array(np.meshgrid(odd, odd, odd)).reshape(3, -1)
    with np.errstate(all="ignore"):
        log_p = build("camera", name).log_likelihood(x, images()[0])
    assert np.isfinite(log_p).all()


@names("camera")
@pytest.mark.parametrize("composed", [n for n in FILTERS if n != "kalman"])
def test_a_filter_steps_by_images_alone(name, composed, set_threads):
    """On one thread and on two; the belief is one, also after an image that says nothing."""
    found = []
    for threads in (1, 2):
        set_threads(threads)
        settings = {"filter": NEEDED.get(("filter", composed), {})}
        whole = Composition(composed, camera=name, settings=settings)
        built = whole.build(open_room(), mosaic())
        bel = built.start(built.environment, Draws(1))
        for step, z in enumerate(images(), start=1):
            bel, info = built.step(bel, MOVES[0], z, Draws(1, step))
            assert bel.particles.weights.sum() == pytest.approx(1.0)
            assert np.isfinite(info.log_evidence)
        found.append((bel.particles.states.tobytes(), bel.particles.log_weights.tobytes()))
    assert found[0] == found[1]


def open_room():
    return OccupancyGrid(np.full((50, 60), FREE, dtype=np.int8), 0.1, np.array([-1.0, 2.0, 0.4]))


@names("sensor")
def test_a_sensor_does_not_depend_on_the_frame_of_the_map(name, x, z):
    """Map and poses moved together: equal but for beams that end on a border of cells."""
    here, frame = grid(), np.array([40.0, -25.0, 2.1])
    there = OccupancyGrid(here.cells, here.resolution, compose(frame, here.origin))
    moved = np.ascontiguousarray(compose(frame, x.T).T)
    a = REGISTRIES["sensor"].make(name, here).log_likelihood(x, z)
    b = REGISTRIES["sensor"].make(name, there).log_likelihood(moved, z)
    # float32 knows a place on this map to 1e-5 cells: of 200 × 60 beams one or so may tip over.
    assert np.mean(np.abs(a - b) > 1e-3) < 0.02


# Sightings of landmarks


SEEN = {
    "known": ([0, 2], [2.0, np.nan], [0.3, -2.0]),
    "no name": ([-1], [1.5], [0.3]),
    "nothing useful": ([1], [np.inf], [np.nan]),
}


@names("sightings")
@pytest.mark.parametrize("seen", SEEN.values(), ids=SEEN)
def test_sightings_give_a_number_whatever_the_chunk_or_order(name, seen, x):
    model, z = build("sightings", name), Sightings(0.0, *seen, mount=np.array([0.2, 0.0, 0.1]))
    whole = model.log_likelihood(x, z)
    assert whole.shape == (200,)
    assert np.isfinite(whole).all()
    assert (np.ptp(whole) > 0.0) == z.useful
    assert model.readings(z) > 0.0
    parts = [
        model.log_likelihood(np.ascontiguousarray(x[:, a:b]), z) for a, b in ((0, 3), (3, 200))
    ]
    assert np.array_equal(whole, np.concatenate(parts))
    order = np.random.default_rng(3).permutation(200)
    shuffled = model.log_likelihood(np.ascontiguousarray(x[:, order]), z)
    assert np.array_equal(whole[order], shuffled)


@names("sightings")
@pytest.mark.parametrize("seen", SEEN.values(), ids=SEEN)
def test_poses_from_sightings_have_their_density(name, seen):
    model, floor = build("sightings", name), FreeSpace(open_floor(landmarks().places, 8.0, ""))
    z = Sightings(0.0, *seen, mount=np.array([0.2, 0.0, 0.1]))
    assert_its_density(AIDS[Landmarks].sampler(model, floor).given(z, Draws(0)), floor)


def assert_its_density(q, environment):
    """What is drawn from q has its density: by importance sampling from U, which is spread over the
    floor evenly, it sums to 1 within 4.5 standard errors, and so does each third of it along x and
    along θ.
    """
    n = 50_000
    drawn, even = q.sample(Draws(1, 1), 0, n), environment.sample(Draws(2, 1), 0, 4 * n)
    w = np.exp(q.log_density(even) - environment.log_density(even))
    # Poses off the floor have none of U: what q has there is drawn and not summed.
    on = np.isfinite(environment.log_density(drawn))
    for k in (0, 2):
        edges = np.quantile(even[k], [0.0, 1.0 / 3.0, 2.0 / 3.0, 1.0])
        for low, high in pairwise(edges):
            within = w * ((even[k] >= low) & (even[k] <= high))
            found = np.mean(on & (drawn[k] >= low) & (drawn[k] <= high))
            error = np.sqrt(within.var() / (4 * n) + found * (1.0 - found) / n)
            assert abs(within.mean() - found) < 4.5 * error
    assert np.isfinite(q.log_density(drawn)).all()
    assert (q.log_density(even) > -np.inf).all()


def measured_of():
    """{aid: it, and what a sensor measures of it}: an aid of the catalog without one fails."""
    here = np.array([[1.0, 3.0, 0.3]]).T
    places = beacons().places
    ranges = np.hypot(np.hypot(*(places[:, :2].T - here[:2])), places[:, 2])
    pixels = mosaic().at(np.random.default_rng(6).uniform(2.0, 4.0, (2, 400))).reshape(20, 20)
    return {
        Landmarks: (landmarks(), Sightings(0.0, [0, -1], [2.0, 1.0], [0.3, np.nan])),
        Beacons: (beacons(), BeaconRanges(0.0, np.arange(3), ranges)),
        Mosaic: (mosaic(), Image(0.0, np.nan_to_num(pixels, nan=0.5))),
        Teammates: (Teammates(), messages()[1]),
    }


@pytest.mark.parametrize(
    ("aid", "name"), [(aid, name) for aid in AIDS for name in CHOICES[AIDS[aid].kind]]
)
def test_poses_from_any_aid_have_their_density(aid, name):
    """On a floor without walls, where those that are drawn may stand."""
    there, z = measured_of()[aid]
    floor = FreeSpace(open_room())
    q = AIDS[aid].sampler(CHOICES[AIDS[aid].kind].make(name, there), floor).given(z, Draws(0))
    assert_its_density(q, floor)
    drawn = q.sample(Draws(1, 1), 0, 200)
    parts = [q.sample(Draws(1, 1), a, b - a) for a, b in ((0, 1), (1, 77), (77, 200))]
    assert np.array_equal(drawn, np.concatenate(parts, axis=1))


# Messages of other robots


def messages():
    """Of a place, of a pose, and of nothing."""
    teller = Particles.equal(np.random.default_rng(8).normal([[0.5], [4.0], [0.3]], 0.3, (3, 400)))
    z, model = Detection(0.0, "me", 1.5, 0.4), DetectionModel(sigma_range=0.2, particles=3000)
    trees = to_seen(teller, z, model, Draws(1)), to_seer(teller, z, model, Draws(1))
    return [*(message(z, tree, model, "robot a") for tree in trees), silence(0.0, "wheels")]


TOLD = dict(zip(("place", "pose", "nothing"), messages(), strict=True))
EACH_TOLD = pytest.mark.parametrize("z", TOLD.values(), ids=TOLD)


@names("message")
@EACH_TOLD
def test_messages_give_a_number_whatever_the_chunk_or_order(name, z, x):
    model = build("message", name)
    whole = model.log_likelihood(x, z)
    assert whole.shape == (200,)
    assert np.isfinite(whole).all()
    assert (np.ptp(whole) > 0.0) == z.useful
    assert model.readings(z) > 0.0
    assert np.isnan(model.explained(x, z)).all() == (not z.useful)
    parts = [
        model.log_likelihood(np.ascontiguousarray(x[:, a:b]), z) for a, b in ((0, 3), (3, 200))
    ]
    assert np.array_equal(whole, np.concatenate(parts))
    order = np.random.default_rng(3).permutation(200)
    shuffled = model.log_likelihood(np.ascontiguousarray(x[:, order]), z)
    assert np.array_equal(whole[order], shuffled)


@names("message")
@EACH_TOLD
def test_poses_from_a_message_have_its_density(name, z):
    environment = FreeSpace(open_floor(landmarks().places, 3.0, ""))
    q = AIDS[Teammates].sampler(build("message", name), environment).given(z, Draws(0))
    assert_its_density(q, environment)
    drawn = q.sample(Draws(1, 1), 0, 200)
    parts = [q.sample(Draws(1, 1), a, b - a) for a, b in ((0, 1), (1, 77), (77, 200))]
    assert np.array_equal(drawn, np.concatenate(parts, axis=1))


@names("message")
@pytest.mark.parametrize("composed", list(FILTERS))
def test_a_filter_steps_by_messages_and_is_the_same_on_threads(name, composed, set_threads):
    """The belief is one, and no message makes a filter doubt its wheels or look elsewhere."""
    found = []
    for threads in (1, 2):
        set_threads(threads)
        settings = {"filter": NEEDED.get(("filter", composed), {})}
        built = Composition(composed, message=name, settings=settings).build(
            open_room(), Teammates()
        )
        known = Gaussian(np.array([0.5, 3.0, 0.2]), np.diag([0.3, 0.3, 0.1]))
        bel = built.start(known, Draws(1))
        alpha = built.step(bel, MOVES[0] * 0.2, silence(0.0, "wheels"), Draws(1, 1))[1].alpha
        for step, z in enumerate(3 * messages(), start=1):
            bel, info = built.step(bel, MOVES[0] * 0.2, z, Draws(1, step))
            assert bel.particles.weights.sum() == pytest.approx(1.0)
            assert np.isfinite(info.log_evidence)
            assert info.alpha == alpha
            assert info.doubt == 0.0
        found.append((bel.particles.states.tobytes(), bel.particles.log_weights.tobytes()))
    assert found[0] == found[1]


@EACH_TOLD
def test_a_localizer_with_a_message_that_waits_is_saved(z, tmp_path):
    localizer = Localizer(open_room(), "mcl", aids=(Teammates(),), seed=1)
    localizer.process(replace(z, t=1.0))
    save(localizer, tmp_path / "state.npz")
    restored = restore(tmp_path / "state.npz", open_room(), (Teammates(),))
    estimates = []
    for one in (localizer, restored):
        one.process(Odometry(0.0, np.zeros(3)))
        estimates += one.process(Odometry(2.0, np.ones(3))) + one.finish()
    if z.useful:
        a, b = estimates
        assert a.pose.tobytes() == b.pose.tobytes()
    assert localizer.ignored == restored.ignored


# Ranges to beacons


@names("ranging")
@pytest.mark.parametrize("d", [0.0, 0.7, 4.0, 49.9, 60.0])
def test_ranges_to_a_beacon_and_none_sum_to_one(name, d):
    """By the trapezoid rule on knots 2 mm apart, which is exact to 10⁻³ where p jumps."""
    model = build("ranging", name)
    r = np.linspace(1e-6, model.range_max, round(model.range_max / 0.002))
    measured = np.trapezoid(model.density(r, np.array(d)), r)
    assert measured + float(model.no_range(np.array(d))) == pytest.approx(1.0, abs=1e-3)


@names("ranging")
def test_ranges_give_a_number_whatever_the_chunk_or_order(name, x):
    model = build("ranging", name)
    z = BeaconRanges(0.0, np.array([0, 2, 1]), np.array([2.0, np.nan, 300.0]), np.ones(3))
    whole = model.log_likelihood(x, z)
    assert whole.shape == (200,)
    assert np.isfinite(whole).all()
    assert np.ptp(whole) > 0.0
    assert model.readings(z) > 0.0
    assert model.beams(z) == 1
    parts = [
        model.log_likelihood(np.ascontiguousarray(x[:, a:b]), z) for a, b in ((0, 3), (3, 200))
    ]
    assert np.array_equal(whole, np.concatenate(parts))


# People


@names("people")
def test_a_filter_for_people_takes_returns_away_and_nothing_else(name, z):
    states = build("environment", "free-space").sample(Draws(1), 0, 1000)
    states[:, 1:] = states[:, :1]
    bel, before = Particles.equal(states), z.ranges.copy()
    cleaned, share = build("people", name).without_people(z, lambda n: bel)
    assert np.array_equal(z.ranges, before, equal_nan=True)
    kept = np.isclose(cleaned.ranges, before, rtol=0.0, atol=0.0, equal_nan=True)
    assert np.isnan(cleaned.ranges[~kept]).all()
    assert z.returned[~kept].all()
    assert share == pytest.approx(np.sum(~kept) / z.returned.sum())


# Environments


@names("environment")
def test_an_environment_samples_where_it_has_density(name, x):
    places = build("environment", name)
    found = places.sample(Draws(1), 0, 300)
    assert found.shape == (3, 300)
    assert np.isfinite(places.log_density(found)).all()
    assert np.isfinite(places.log_prior(x)).all()
    assert (places.log_prior(x) <= 0.0).all()
    assert places.log_prior(found) == pytest.approx(0.0)
    parts = [places.sample(Draws(1), 0, 7), places.sample(Draws(1), 7, 293)]
    assert np.array_equal(found, np.concatenate(parts, axis=1))


# Sizes and resamplers


@names("size")
@pytest.mark.parametrize("chunk", [1, 64, 5000])
def test_a_size_does_not_depend_on_chunks(name, chunk):
    """It wants the same number of particles whatever the chunks they come in."""
    states = np.random.default_rng(4).normal(0.0, 0.1, (3, 40_000))
    rule = build("size", name)
    expected = rule.counter(SE2, 0, 0).enough(states, np.zeros(40_000))
    assert 1 <= expected <= 40_000
    assert rule.fixed in (None, expected)
    counter, done, enough = rule.counter(SE2, 0, 0), 0, None
    while enough is None:
        part = np.ascontiguousarray(states[:, done : done + chunk])
        enough = counter.enough(part, np.zeros(part.shape[1]))
        done += part.shape[1]
    assert done - part.shape[1] + enough == expected


@names("resampler")
@pytest.mark.parametrize("n", [None, 300])
def test_a_resampler_gives_ancestors_whatever_the_chunk(name, n):
    log_weights = np.random.default_rng(5).normal(0.0, 3.0, 100)
    particles = Particles.normalized(np.zeros((3, 100)), log_weights)
    resampler = build("resampler", name)
    if resampler.needs_n and n is None:
        with pytest.raises(ConfigError, match="--size fixed"):
            resampler(particles, n, Draws(1, 1))
        return
    ancestry = resampler(particles, n, Draws(1, 1))
    whole = ancestry.of(0, 300)
    assert whole.shape == (300,)
    assert np.issubdtype(whole.dtype, np.integer)
    assert whole.min() >= 0
    assert whole.max() < 100
    assert np.array_equal(whole, np.concatenate([ancestry.of(0, 11), ancestry.of(11, 289)]))


@names("resampler")
def test_a_resampler_is_unbiased(name):
    """Mean weight of descendants over 2000 seeds: at worst multinomial, variance n q (1 − q) for
    one that draws by q, each then of weight w / q; 4.5 deviations.
    """
    particles = Particles.normalized(np.zeros((3, 6)), np.log([0.7, 0.15, 0.1, 0.04, 0.01, 1e-12]))
    counts, n, each = np.zeros(6), 20, np.ones(6)
    for seed in range(2000):
        ancestry = build("resampler", name)(particles, n, Draws(seed, 1))
        counts += np.bincount(ancestry.of(0, n), minlength=6)
        if ancestry.log_weights is not None:
            each = 6 * np.exp(ancestry.log_weights)
    w = particles.weights
    q = w / each
    assert q.sum() == pytest.approx(1.0)
    deviation = each * np.sqrt(n * q * (1.0 - q) / 2000)
    assert (np.abs(each * counts / 2000 - n * w) <= 4.5 * deviation + 1e-3).all()


# Paces


@names("pace")
def test_a_pace_asks_for_more_time_the_more_there_is_to_do(name):
    pace = build("pace", name)
    assert isinstance(pace.clocked, bool)

    def seconds(n, beams, duration):
        info = StepInfo(n, 1.0, 0.0, Evidence(), n, sizes=(n,))
        particles = Particles.equal(np.zeros((3, 2)))
        return pace.seconds(Update(1, info, particles, (), 1.0, duration), beams)

    least = seconds(1, 1, 1e-6)
    assert 0.0 <= least < np.inf
    assert all(least <= seconds(*work) < np.inf for work in ((9, 1, 1e-6), (1, 9, 1e-6), (1, 1, 9)))


# Whole filters


WITHOUT_SIZE = "markov-grid", "octree", "kalman", "topological"
COMPOSED = [
    *itertools.product(
        [name for name in FILTERS if name not in WITHOUT_SIZE],
        REGISTRIES["recovery"],
        REGISTRIES["size"],
    ),
    *((name, "augmented", "kld") for name in WITHOUT_SIZE),
]


def room():
    """5 m × 4 m with a wall and a pillar; nobody knows what lies outside."""
    cells = np.full((50, 60), UNKNOWN, dtype=np.int8)
    cells[4:46, 4:56] = OCCUPIED
    cells[5:45, 5:55] = FREE
    cells[20:22, 5:30] = OCCUPIED
    cells[32:36, 40:45] = OCCUPIED
    return OccupancyGrid(cells, 0.1, np.array([-1.0, 2.0, 0.4]), name="room")


def composed(name, recovery="augmented", size="kld"):
    settings = {"size": NEEDED.get(("size", size), {}), "filter": NEEDED.get(("filter", name), {})}
    return Composition(name, recovery=recovery, size=size, settings=settings)


def started(built, name):
    """Where the robot may be anywhere, if the filter can start so."""
    around = Gaussian(compose(built.environment.grid.origin, [1.5, 3.0, 0.3]), np.eye(3) * 0.01)
    return built.start(around if name == "kalman" else built.environment, Draws(1))


@pytest.mark.parametrize(("name", "recovery", "size"), COMPOSED)
def test_a_filter_steps_from_belief_to_belief(name, recovery, size, z):
    """Three steps: weights sum to 1, the belief given is left alone, a repeat is the same."""
    built = composed(name, recovery, size).build(room())
    bel = started(built, name)
    for step in (1, 2, 3):
        before = bel.particles.states.copy()
        new, info = built.step(bel, MOVES[0], z, Draws(1, step))
        again, _ = built.step(bel, MOVES[0], z, Draws(1, step))
        assert np.array_equal(bel.particles.states, before)
        assert np.array_equal(new.particles.states, again.particles.states)
        assert np.array_equal(new.particles.log_weights, again.particles.log_weights)
        assert np.isfinite(new.particles.states).all()
        assert new.particles.weights.sum() == pytest.approx(1.0)
        # Of the states of places, several poses each stand for one.
        assert info.n == len(new.particles) or name == "topological"
        assert 1.0 <= info.ess <= info.n * (1.0 + 1e-9)
        assert 0.0 <= info.alpha <= 1.0
        assert 0.0 <= info.doubt <= 1.0
        assert 0.0 <= info.filtered <= 1.0
        bel = new


@pytest.mark.parametrize("name", list(FILTERS))
def test_a_belief_is_packed_unpacked_and_adopted(name, z):
    """What was packed goes on with the same bytes; what another filter adopts goes on."""
    built = composed(name).build(room())
    bel = started(built, name)
    for step in (1, 2):
        bel, _ = built.step(bel, MOVES[0], z, Draws(1, step))
    values, arrays = built.packed(bel)
    again = built.unpacked(json.loads(json.dumps(values)), arrays, dict(bel.evidence))
    one, info = built.step(bel, MOVES[0], z, Draws(1, 3))
    other, repeated = built.step(again, MOVES[0], z, Draws(1, 3))
    assert one.particles.states.tobytes() == other.particles.states.tobytes()
    assert one.particles.log_weights.tobytes() == other.particles.log_weights.tobytes()
    assert info == repeated
    new = composed(name).build(room())
    adopted = new.adopted(bel)
    assert adopted.evidence == {}
    after, _ = new.step(adopted, MOVES[0], z, Draws(1, 3))
    assert after.particles.weights.sum() == pytest.approx(1.0)


@pytest.mark.parametrize("name", list(FILTERS))
def test_hypotheses_are_poses_with_their_shares(name, z):
    built = composed(name).build(room())
    bel, _ = built.step(started(built, name), MOVES[0], z, Draws(1, 1))
    found = built.hypotheses(bel)
    shares = [h.share for h in found]
    assert shares == sorted(shares, reverse=True)
    assert 0.0 <= sum(shares) <= 1.0 + 1e-9
    for h in found:
        assert h.mean.shape == (3,)
        assert abs(h.mean[2]) <= np.pi
        assert np.linalg.eigvalsh(h.covariance).min() > -1e-9


@pytest.mark.parametrize("name", list(FILTERS))
def test_a_filter_does_not_depend_on_threads(name, z, set_threads):
    found = []
    for threads in (1, 2):
        set_threads(threads)
        built = composed(name).build(room())
        bel = started(built, name)
        for step in (1, 2):
            bel, _ = built.step(bel, MOVES[0], z, Draws(1, step))
        found.append((bel.particles.states.tobytes(), bel.particles.log_weights.tobytes()))
    assert found[0] == found[1]


@pytest.mark.parametrize("name", list(FILTERS))
def test_a_localizer_with_any_filter_is_saved_and_goes_on_the_same(name, z, tmp_path):
    grid = room()
    start = compose(grid.origin, [1.5, 3.0, 0.3]) if name == "kalman" else None
    scans = [replace(z, t=float(k), odometry=np.array([0.3 * k, 0.1, 0.1 * k])) for k in range(6)]
    whole = Localizer(grid, composed(name), seed=3, initial=start)
    for scan in scans[:3]:
        whole.process(scan)
    save(whole, tmp_path / "state")
    again = restore(tmp_path / "state", grid)
    rest = [[(e.pose, e.update.info) for e in x.run(scans[3:])] for x in (whole, again)]
    assert len(rest[0]) == len(rest[1])
    for (one, info), (other, repeated) in zip(*rest, strict=True):
        assert np.array_equal(one, other)
        assert info == repeated
    assert whole.ignored == again.ignored


@names("motion")
@pytest.mark.parametrize("resampler", list(REGISTRIES["resampler"]))
def test_a_filter_steps_with_every_motion_and_resampler(name, resampler, z):
    built = Composition(motion=name, resampler=resampler, size="fixed").build(grid())
    bel = built.start(built.environment, Draws(1))
    for step in (1, 2):
        bel, info = built.step(bel, MOVES[0], z, Draws(1, step))
        assert info.n == 5000
        assert np.isfinite(bel.particles.states).all()
        assert bel.particles.weights.sum() == pytest.approx(1.0)


@names("sensor")
@pytest.mark.parametrize("people", list(REGISTRIES["people"]))
def test_a_filter_steps_with_every_sensor_and_filter_for_people(name, people, z):
    """From a belief that is sure of itself, twice the same."""
    built = Composition(sensor=name, people=people, size="fixed").build(grid())
    start = built.environment.sample(Draws(1), 0, 300)
    start[:] = start[:, :1]
    bel = ParticleBelief(Particles.equal(start))
    new, info = built.step(bel, MOVES[0], z, Draws(1, 1))
    again, _ = built.step(bel, MOVES[0], z, Draws(1, 1))
    assert np.array_equal(new.particles.log_weights, again.particles.log_weights)
    assert np.isfinite(new.particles.states).all()
    assert new.particles.weights.sum() == pytest.approx(1.0)
    assert info.filtered == 0.0 or people != "none"


@pytest.mark.parametrize(
    ("name", "settings"),
    [(name, {}) for name in REGISTRIES["sensor"]]
    + [("beam-yee", {"ranges": "table", "table_angles": angles}) for angles in (4, 7, 180)],
)
def test_no_pose_is_too_odd_for_a_sensor(name, settings, z):
    """Kernels index memory by what they compute from poses: none may lead out of it."""
    odd = [np.nan, np.inf, -np.inf, 1e300, -1e300, 1e18, 1e5, -1e5, 0.0, np.pi, -np.pi, 7.0]
    x = np.array(np.meshgrid(odd, odd, odd)).reshape(3, -1)
    with np.errstate(all="ignore"):
        log_p = build("sensor", name, **settings).log_likelihood(x, z)
    assert np.isfinite(log_p).all()
