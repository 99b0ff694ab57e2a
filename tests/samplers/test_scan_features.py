"""Features of scans: what counts of a reading, what a laser sees, and turns of a ring of ranges."""

import numpy as np
import pytest

from mcloc.events import Scan
from mcloc.samplers.scan_features import Sectors, heard

REACH, RAYS = 12.0, 360
HALF = np.deg2rad(np.arange(-90.0, 91.0))
FIELDS = {
    "half, 181 beams": HALF,
    "half, 180 beams": HALF[:-1],
    "half, clockwise": HALF[::-1],
    "half, two a degree": np.deg2rad(np.arange(-90.0, 90.0, 0.5)),
    "three quarters": np.deg2rad(np.arange(-135.0, 135.5, 0.25)),
    "all, from 0": np.deg2rad(np.arange(360.0)),
    "all, to pi twice": np.linspace(-np.pi, np.pi, 361),
    "backwards": HALF + np.pi,
}


def scan(angles, ranges, **more):
    return Scan(0.0, np.asarray(ranges, dtype=np.float64), angles, 10.0, **more)


def smooth(angles):
    """Ranges that change slowly with the direction."""
    return 3.0 + 2.0 * np.cos(angles - 0.7) + np.sin(3.0 * angles)


@pytest.mark.parametrize("angles", FIELDS.values(), ids=FIELDS)
def test_scans_have_the_features_of_their_rings(angles):
    """A ring of one place, ranges all around; the scan of each heading is measured anew."""
    headings = 36
    sectors = Sectors.of(angles, 16, RAYS, REACH)
    ring = smooth(np.arange(RAYS) * 2.0 * np.pi / RAYS)[None]
    simulated = sectors.of_rings(ring, headings)
    assert simulated.shape == (16, 1, headings)
    for k in (0, 1, 17, 35):
        turned = smooth(angles + k * 2.0 * np.pi / headings)
        # Beams a quarter of a degree apart are not those of the ring, and end half a degree early
        # or late in a sector: the slope, at most 5 m in 4 m a radian, times a degree.
        assert sectors.of_scan(scan(angles, turned)) == pytest.approx(
            simulated[:, 0, k], abs=5.0 / 4.0 * np.deg2rad(1.0)
        )


@pytest.mark.parametrize("name", ["half, 181 beams", "half, 180 beams", "all, from 0", "backwards"])
def test_beams_of_the_ring_give_the_very_same(name):
    angles = FIELDS[name]
    sectors = Sectors.of(angles, 12, RAYS, REACH)
    ranges = np.random.default_rng(1).uniform(0.1, 9.9, RAYS)
    rays = np.rint(np.rad2deg(angles)).astype(int)
    for k in (0, 5, 30):
        of_scan = sectors.of_scan(scan(angles, ranges[(rays + 10 * k) % RAYS]))
        assert of_scan == pytest.approx(sectors.of_rings(ranges[None], 36)[:, 0, k], abs=1e-6)


@pytest.mark.parametrize("angles", FIELDS.values(), ids=FIELDS)
def test_sectors_share_the_field_of_view(angles):
    sectors = Sectors.of(angles, 16, RAYS, REACH)
    beam = np.median(np.abs(np.diff(angles)))
    seen = min(np.ptp(angles) + beam, 2.0 * np.pi)
    assert sectors.width * 16 == pytest.approx(seen, abs=1e-6)
    assert sectors.first[-1] - sectors.first[0] == pytest.approx(np.rad2deg(seen), abs=1.0)
    sizes = np.diff(sectors.first)
    assert sizes.max() - sizes.min() <= 1


def test_lasers_that_see_the_same_share_their_features():
    one = Sectors.of(HALF, 16, RAYS, REACH)
    assert (
        one
        == Sectors.of(HALF[::-1], 16, RAYS, REACH)
        == Sectors.of(HALF + 2 * np.pi, 16, RAYS, REACH)
    )
    assert hash(one) == hash(Sectors.of(HALF + 1e-9, 16, RAYS, REACH))
    assert one != Sectors.of(HALF, 16, RAYS, 20.0)
    assert one != Sectors.of(HALF + 0.2, 16, RAYS, REACH)


@pytest.mark.parametrize(
    ("degrees", "count"), [([30.0], 1), ([-2.0, 2.0], 8), ([-1.0, 0.0, 1.0], 3)]
)
def test_narrow_fields_have_fewer_sectors_but_rays_in_each(degrees, count):
    sectors = Sectors.of(np.deg2rad(degrees), 16, RAYS, REACH)
    assert sectors.count == count
    assert (np.diff(sectors.first) >= 1).all()
    features = sectors.of_scan(scan(np.deg2rad(degrees), np.full(len(degrees), 2.0)))
    assert features[~np.isnan(features)] == pytest.approx(np.log(3.0))


def test_no_return_is_as_far_as_the_reach_and_errors_are_left_out():
    angles = np.deg2rad(np.arange(8.0))
    r = np.array([2.0, np.inf, 10.0, 81.9, np.nan, -np.inf, 0.0, 0.2])
    z = scan(angles, r, range_min=0.3)
    assert heard(z).tolist() == [True, True, True, True, False, False, False, False]
    sectors = Sectors.of(angles, 1, RAYS, 10.0)
    expected = (np.log(3.0) + 3.0 * np.log(11.0)) / 4.0
    assert sectors.of_scan(z) == pytest.approx([expected])


def test_a_sector_of_errors_alone_says_nothing():
    ranges = np.full(181, 2.0)
    ranges[:91] = np.nan
    features = Sectors.of(HALF, 2, RAYS, REACH).of_scan(scan(HALF, ranges))
    assert np.isnan(features[0])
    assert features[1] == pytest.approx(np.log(3.0))


def test_rays_that_leave_the_map_are_left_out():
    ring = np.full((1, RAYS), 2.0)
    ring[0, 45:90] = np.nan
    ring[0, 180:] = np.nan
    ring[0, 90:135] = np.inf
    features = Sectors.of(np.deg2rad(np.arange(360.0)), 4, RAYS, REACH).of_rings(ring, 4)
    # Sectors begin at -180 degrees: of the last three quarters of the circle two are empty.
    far = np.log1p(REACH)
    assert features[:, 0, 0] == pytest.approx(
        [far, far, np.log(3.0), 0.5 * (far + np.log(3.0))], abs=1e-6
    )
    # A quarter turn to the left: each sector sees what the next one saw.
    assert features[:, 0, 1] == pytest.approx(np.roll(features[:, 0, 0], -1))
