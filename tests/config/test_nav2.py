"""Parameter files of amcl as runs: numbers that agree with amcl's formulas, written out here, a
note for each difference, and no file that is half understood.
"""

import math
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from mcloc.config import RunConfig, merged
from mcloc.config.nav2 import read_nav2
from mcloc.errors import ConfigError, McLocError
from mcloc.events import Scan
from mcloc.filters.catalog import REGISTRIES
from mcloc.localizer import Localizer
from mcloc.maps.occupancy import OccupancyGrid
from mcloc.simulation import office_drive

DEFAULTS = """
amcl:
  ros__parameters:
    use_sim_time: True
    alpha1: 0.2
    alpha2: 0.2
    alpha3: 0.2
    alpha4: 0.2
    alpha5: 0.2
    base_frame_id: "base_footprint"
    beam_skip_distance: 0.5
    beam_skip_error_threshold: 0.9
    beam_skip_threshold: 0.3
    do_beamskip: false
    global_frame_id: "map"
    lambda_short: 0.1
    laser_likelihood_max_dist: 2.0
    laser_max_range: 100.0
    laser_min_range: -1.0
    laser_model_type: "likelihood_field"
    max_beams: 60
    max_particles: 2000
    min_particles: 500
    odom_frame_id: "odom"
    pf_err: 0.05
    pf_z: 0.99
    recovery_alpha_fast: 0.0
    recovery_alpha_slow: 0.0
    resample_interval: 1
    robot_model_type: "nav2_amcl::DifferentialMotionModel"
    save_pose_rate: 0.5
    sigma_hit: 0.2
    tf_broadcast: true
    transform_tolerance: 1.0
    update_min_a: 0.2
    update_min_d: 0.25
    z_hit: 0.5
    z_max: 0.05
    z_rand: 0.5
    z_short: 0.05
    scan_topic: scan
"""

Read = Callable[[str], tuple[dict[str, Any], list[str]]]


@pytest.fixture
def read(tmp_path: Path) -> Read:
    """What read_nav2 makes of a text."""

    def of(text: str) -> tuple[dict[str, Any], list[str]]:
        path = tmp_path / "amcl.yaml"
        path.write_text(text, encoding="utf-8")
        return read_nav2(path)

    return of


def ros2(**values: object) -> str:
    """A file of nav2 with these parameters."""
    lines = (f"    {name.replace('__', '.')}: {value}" for name, value in values.items())
    return "\n".join(["amcl:", "  ros__parameters:", *lines]) + "\n"


def ros1(**values: object) -> str:
    return "\n".join(["amcl:", *(f"  {name}: {value}" for name, value in values.items())]) + "\n"


def part(entries: dict[str, Any], kind: str, *bound: object) -> Any:
    return REGISTRIES[kind].make(entries[kind], *bound, **entries["settings"][kind])


def about(notes: list[str], name: str) -> str:
    """The one note that begins with a name."""
    (found,) = [note for note in notes if note.startswith(f"{name}:")]
    return found


def test_the_file_that_comes_with_nav2(read: Read) -> None:
    entries, notes = read(DEFAULTS)
    z = (0.5 / 100.0) / (0.5 + 0.5 / 100.0)
    assert entries == {
        "motion": "odometry",
        "sensor": "likelihood-field",
        "size": "kld",
        "resampler": "systematic",
        "recovery": "none",
        "settings": {
            "motion": {f"alpha{i}": pytest.approx(math.sqrt(0.2)) for i in range(1, 5)},
            "sensor": {
                "sigma_hit": 0.2,
                "z_rand": pytest.approx(z),
                "z_unknown": pytest.approx(z),
                "max_beams": 60,
            },
            "size": {
                "epsilon": 0.05,
                "delta": pytest.approx(stats.norm.sf(0.99)),
                "bin_length": 0.5,
                "bin_angle": pytest.approx(np.deg2rad(10.0)),
                "minimum": 500,
                "maximum": 2000,
            },
            "resampler": {},
            "recovery": {},
            "update": {"distance": 0.25, "angle": 0.2},
        },
    }
    assert "whole map is searched" in about(notes, "set_initial_pose")
    (node,) = [note for note in notes if "ROS node" in note]
    assert "tf_broadcast" in node
    assert "scan_topic" in node
    assert not any("not in the file" in note or "no parameter of" in note for note in notes)


def test_what_is_not_in_the_file_is_as_the_node_has_it(read: Read) -> None:
    entries, notes = read(ros2(alpha1=0.2))
    assert entries == read(DEFAULTS)[0]
    (absent,) = [note for note in notes if note.startswith("not in the file")]
    assert "sigma_hit" in absent
    assert "alpha1" not in absent
    old, _ = read(ros1(odom_alpha1=0.2))
    assert old["settings"]["size"]["maximum"] == 5000
    assert old["settings"]["sensor"]["max_beams"] == 30
    assert old["settings"]["update"]["angle"] == pytest.approx(math.pi / 6)


@pytest.mark.parametrize(
    "text",
    [
        "/amcl:\n  ros__parameters: {sigma_hit: 0.3}",
        "/**:\n  ros__parameters: {sigma_hit: 0.3}",
        "/**:\n  ros__parameters: {sigma_hit: 9.0}\namcl:\n  ros__parameters: {sigma_hit: 0.3}",
        "robot1:\n  amcl:\n    ros__parameters: {sigma_hit: 0.3}",
        "/robot1/amcl:\n  ros__parameters: {sigma_hit: 0.3}",
        "robot1/nav:\n  amcl:\n    ros__parameters: {sigma_hit: 3e-1}",
        "other:\n  ros__parameters: {sigma_hit: 9.0}\namcl:\n  ros__parameters: {sigma_hit: 0.3}",
        "amcl: {laser_sigma_hit: 0.3}",
        "robot1: {amcl: {laser_sigma_hit: 0.3}}",
        "laser_sigma_hit: 0.3",
    ],
)
def test_wherever_amcl_stands(read: Read, text: str) -> None:
    assert read(text)[0]["settings"]["sensor"]["sigma_hit"] == 0.3


def deviations(model: Any, u: tuple[float, float, float]) -> Any:
    """Of a motion model for a move, with hardly any noise at rest."""
    return model.decompose(np.array(u))


def test_variances_become_deviations(read: Read) -> None:
    """nav2_amcl: σ_rot² = α1 rot² + α2 trans², σ_trans² = α3 trans² + α4 rot²."""
    entries, _ = read(ros2(alpha1=0.1, alpha2=0.2, alpha3=0.3, alpha4=0.4))
    entries["settings"]["motion"] |= {"sigma_rot_min": 1e-9, "sigma_trans_min": 1e-9}
    model = part(entries, "motion")
    straight, turned = deviations(model, (2.0, 0.0, 0.0)), deviations(model, (0.0, 0.0, 0.5))
    assert straight.sd_rot1 == pytest.approx(math.sqrt(0.2 * 4.0))
    assert straight.sd_trans == pytest.approx(math.sqrt(0.3 * 4.0))
    assert turned.sd_rot2 == pytest.approx(math.sqrt(0.1 * 0.25))
    assert turned.sd_trans == pytest.approx(math.sqrt(0.4 * 0.25))


def test_a_robot_that_drives_any_way(read: Read) -> None:
    """nav2_amcl: σ_strafe² = α4 rot² + α5 trans², besides."""
    alphas = {f"alpha{i}": i / 10 for i in range(1, 6)}
    entries, notes = read(ros2(robot_model_type="nav2_amcl::OmniMotionModel", **alphas))
    assert entries["motion"] == "omnidirectional"
    assert not any(note.startswith("alpha") for note in notes)
    entries["settings"]["motion"] |= {"sigma_rot_min": 1e-9, "sigma_trans_min": 1e-9}
    d = deviations(part(entries, "motion"), (1.0, 1.0, 0.5))
    assert d.sd_rot == pytest.approx(math.sqrt(0.1 * 0.25 + 0.2 * 2.0))
    assert d.sd_trans == pytest.approx(math.sqrt(0.3 * 2.0 + 0.4 * 0.25))
    assert d.sd_strafe == pytest.approx(math.sqrt(0.4 * 0.25 + 0.5 * 2.0))


def test_the_uncorrected_models_of_ros1(read: Read) -> None:
    """amcl_odom: "diff" takes variances for deviations, "omni" also alpha1 for alpha4."""
    alphas = {f"odom_alpha{i}": i / 10 for i in range(1, 6)}
    moved = {"update_min_d": 0.5, "update_min_a": 0.4}
    entries, notes = read(ros1(odom_model_type="diff", **alphas, **moved))
    entries["settings"]["motion"] |= {"sigma_rot_min": 1e-9, "sigma_trans_min": 1e-9}
    model = part(entries, "motion")
    assert deviations(model, (0.5, 0.0, 0.0)).sd_rot1 == pytest.approx(0.2 * 0.25)
    assert deviations(model, (0.5, 0.0, 0.0)).sd_trans == pytest.approx(0.3 * 0.25)
    assert deviations(model, (0.0, 0.0, 0.4)).sd_rot2 == pytest.approx(0.1 * 0.16)
    assert deviations(model, (0.0, 0.0, 0.4)).sd_trans == pytest.approx(0.4 * 0.16)
    assert "square root" in about(notes, "odom_model_type")
    corrected, _ = read(ros1(odom_model_type="diff-corrected", **alphas))
    assert corrected["settings"]["motion"]["alpha2"] == pytest.approx(math.sqrt(0.2))
    omni, _ = read(ros1(odom_model_type="omni", **alphas, **moved))
    omni["settings"]["motion"] |= {"sigma_rot_min": 1e-9, "sigma_trans_min": 1e-9}
    turned = deviations(part(omni, "motion"), (0.0, 0.0, 0.4))
    assert turned.sd_rot == pytest.approx(0.4 * 0.16)
    assert turned.sd_strafe == pytest.approx(0.1 * 0.16)


def wall() -> OccupancyGrid:
    """Free space with one wall along y at x = 10 m."""
    cells = np.zeros((40, 120), dtype=np.int8)
    cells[:, 100] = 100
    return OccupancyGrid(cells, 0.1, np.zeros(3))


def beam(reading: float, range_max: float) -> Scan:
    return Scan(0.0, np.array([reading]), np.zeros(1), range_max)


@pytest.mark.parametrize(("far", "distances"), [(2.0, (0.0, 0.2, 0.5, 3.0)), (0.3, (0.0, 3.0))])
def test_a_beam_weighs_as_in_the_likelihood_field_of_amcl(
    read: Read, far: float, distances: tuple[float, ...]
) -> None:
    """LikelihoodFieldModelProb: z_hit exp(−d²/2σ²) + z_rand / range_max, d cut at its maximum."""
    values = {"sigma_hit": 0.25, "z_hit": 0.7, "z_rand": 0.3, "laser_max_range": 20.0}
    entries, _ = read(ros2(laser_likelihood_max_dist=far, **values))
    entries["settings"]["sensor"]["effective_beams"] = 1.0
    model = part(entries, "sensor", wall())

    def amcl(d: float) -> float:
        return 0.7 * math.exp(-(min(d, far) ** 2) / (2 * 0.25**2)) + 0.3 / 20.0

    at = np.array([[1.05], [2.0], [0.0]])  # 9 m before the wall, all in the middle of cells
    for d in distances:
        (log_p,) = model.log_likelihood(at, beam(9.0 - d, 20.0))
        # 16 bits from a perfect reading down to none.
        half_step = 0.5 * math.log(amcl(0.0) / (0.3 / 20.0)) / 65535
        assert log_p == pytest.approx(math.log(amcl(d) / amcl(0.0)), abs=half_step + 1e-6)


def test_a_reading_weighs_as_in_the_beam_model_of_amcl(read: Read) -> None:
    """BeamModel: z_hit exp(−(z−e)²/2σ²) + z_short λ exp(−λ z) [z < e] + z_max [none] + z_rand/R."""
    values = {"sigma_hit": 0.2, "z_hit": 0.5, "z_short": 0.05, "z_max": 0.05, "z_rand": 0.5}
    entries, notes = read(ros2(laser_model_type="beam", lambda_short=0.1, **values))
    assert "densities" in about(notes, "z_hit, z_short, z_max, z_rand")
    model, reach = part(entries, "sensor", wall()), 20.0

    def ratio(z: float, one: float, other: float) -> float:
        p, q = model.density(np.array(z), np.array([one, other]), reach)
        return float(p / q)

    def amcl(z: float, e: float) -> float:
        p = 0.5 * math.exp(-((z - e) ** 2) / (2 * 0.2**2)) if math.isfinite(e) or z < reach else 0.5
        p += 0.05 * 0.1 * math.exp(-0.1 * z) if z < min(e, reach) else 0.0
        return p + (0.05 if z >= reach else 0.5 / reach)

    # The book normalizes `short` up to the wall, amcl does not: a few percent of the floor.
    for z, one, other in [(5.0, 5.0, 3.0), (5.0, 5.1, 3.0), (reach, math.inf, 10.0)]:
        assert ratio(z, one, other) == pytest.approx(amcl(z, one) / amcl(z, other), rel=0.03)


@given(k=st.integers(2, 3000), pf_err=st.floats(1e-3, 1.0), pf_z=st.floats(0.0, 7.0))
def test_as_many_particles_as_in_amcl(tmp_path_factory, k, pf_err, pf_z):  # type: ignore[no-untyped-def]
    """pf_resample_limit: pf_z is the normal quantile itself."""
    path = tmp_path_factory.mktemp("amcl") / "amcl.yaml"
    path.write_text(ros2(pf_err=pf_err, pf_z=pf_z), encoding="utf-8")
    b = 2.0 / (9.0 * (k - 1))
    limit = (k - 1) / (2.0 * pf_err) * (1.0 - b + math.sqrt(b) * pf_z) ** 3
    assert part(read_nav2(path)[0], "size").bound(k) == pytest.approx(limit, rel=1e-4)


def test_recovery(read: Read) -> None:
    """w_diff = 1 − w_fast / w_slow."""
    entries, notes = read(ros2(recovery_alpha_slow=0.001, recovery_alpha_fast=0.1))
    assert entries["recovery"] == "augmented"
    # An update after 0.25 m is 6 readings of the 12 that a scan is worth after 0.5 m.
    assert entries["settings"]["recovery"] == pytest.approx(
        {"rate_slow": 1 - 0.999 ** (1 / 6), "rate_fast": 1 - 0.9 ** (1 / 6), "below": 1.0}
    )
    assert any("the same for an update after 0.25 m" in note for note in notes)
    assert any("cautiously" in note for note in notes)
    half, notes = read(ros2(recovery_alpha_slow=0.001))
    assert half["recovery"] == "none"
    assert any("only one" in note for note in notes)


def test_where_to_start(read: Read) -> None:
    pose = {"initial_pose__x": 1.0, "initial_pose__y": -2, "initial_pose__yaw": 0.5}
    entries, notes = read(ros2(set_initial_pose="true", **pose))
    assert entries["initial"] == (1.0, -2.0, 0.5)
    assert entries["initial_sigma"] == pytest.approx((0.5, 0.5, math.radians(15.0)))
    assert "exact" in about(notes, "initial_pose")
    nested, _ = read(ros2(set_initial_pose="true", initial_pose="{x: 1.0, y: -2, yaw: 0.5}"))
    assert nested["initial"] == entries["initial"]
    assert "initial" not in read(ros2(**pose))[0]
    covariances = {"initial_cov_xx": 0.04, "initial_cov_yy": 0.09, "initial_cov_aa": 0.01}
    old, notes = read(ros1(initial_pose_x=3.0, initial_pose_a=0.5, **covariances))
    assert old["initial"] == (3.0, 0.0, 0.5)
    assert old["initial_sigma"] == pytest.approx((0.2, 0.3, 0.1))
    old, notes = read(ros1(odom_alpha1=0.1))
    assert "initial" not in old
    assert "searched" in about(notes, "initial_pose_x")


def test_the_seed(read: Read) -> None:
    assert read(ros2(random_seed=7))[0]["seed"] == 7
    assert "seed" not in read(ros2(random_seed=-1))[0]


@pytest.mark.parametrize(
    ("text", "name", "says"),
    [
        (ros2(do_beamskip="true"), "do_beamskip", "kept"),
        (ros2(laser_max_range=12.0), "laser_max_range", "not applied"),
        (ros2(resample_interval=3), "resample_interval", "each update"),
        (ros2(min_particles=3000), "max_particles", "3000"),
        (ros2(robot_model_type="my::Ackermann"), "robot_model_type", "odometry is used"),
        (ros2(freespace_downsampling="true"), "freespace_downsampling", "all free cells"),
        (ros2(sigma_hit=9.0), "sensor.sigma_hit", "5 is used"),
        (ros2(alpha1=400.0), "motion.alpha1", "10 is used"),
        (ros2(sigma_hti=0.1, alpha1=0.2), "sigma_hti", "did you mean 'sigma_hit'"),
        (ros2(laser_z_hit=0.1, alpha1=0.2), "laser_z_hit", "not used"),
        (ros1(z_hit=0.1, odom_alpha1=0.2), "z_hit", "did you mean 'laser_z_hit'"),
    ],
)
def test_a_note_for_what_is_not_taken_over(read: Read, text: str, name: str, says: str) -> None:
    _, notes = read(text)
    assert says in about(notes, name)


def test_resampling_only_where_the_weights_ask_for_it(read: Read) -> None:
    entries, _ = read(ros1(selective_resampling="true"))
    assert entries["resampler"] == "selective"
    assert entries["settings"]["resampler"] == {"ess_below": 0.5}


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("map_server:\n  ros__parameters: {yaml_filename: a.yaml}", "only of map_server"),
        ("/**:\n  ros__parameters: {use_sim_time: true}", "no parameters of amcl"),
        ("image: map.pgm\nresolution: 0.05", "no parameters of amcl"),
        ("a/amcl:\n  ros__parameters: {}\nb/amcl:\n  ros__parameters: {}", "a/amcl, b/amcl"),
        ("a: {amcl: {kld_z: 1}}\nb: {amcl: {kld_z: 1}}", "several amcl nodes"),
        (ros2(sigma_hit=-0.1), "sigma_hit: Amcl.sigma_hit = -0.1 m must be > 0"),
        (ros2(sigma_hit="wide"), "sigma_hit: Amcl.sigma_hit must be a number"),
        (ros2(sigma_hit="true"), "must be a number"),
        (ros2(sigma_hit=".nan"), "must be a number"),
        (ros2(alpha3=-1), "alpha3: Amcl.alpha3 = -1 must be >= 0"),
        (ros2(max_beams=1), "max_beams"),
        (ros2(min_particles=2.5), "min_particles: Amcl.min_particles must be a whole number"),
        (ros2(laser_model_type="sonar"), "must be one of beam, likelihood_field"),
        (ros2(robot_model_type=3), "must be str"),
        (ros2(do_beamskip=1), "must be bool"),
        (ros2(pf_err="[1, 2]"), "must be a number"),
        (ros1(laser_sigma_hit=-0.1), "laser_sigma_hit: Amcl.sigma_hit"),
        ("amcl: [", "not YAML"),
        ("", "no entries"),
    ],
)
def test_a_file_that_cannot_be_right(read: Read, text: str, says: str) -> None:
    with pytest.raises(ConfigError, match=r"amcl\.yaml") as caught:
        read(text)
    assert says in str(caught.value)
    assert "\n" not in str(caught.value)


@given(
    values=st.fixed_dictionaries(
        {},
        optional={
            **{f"alpha{i}": st.floats(0.0, 1e6) for i in range(1, 6)},
            **{name: st.floats(1e-9, 1e6) for name in ("sigma_hit", "z_hit", "lambda_short")},
            **{name: st.floats(0.0, 1e6) for name in ("z_rand", "z_short", "z_max")},
            "laser_max_range": st.just(-1) | st.floats(0.1, 1e6),
            "laser_likelihood_max_dist": st.floats(1e-3, 1e6),
            "max_beams": st.integers(2, 10**6),
            "min_particles": st.integers(1, 10**6),
            "max_particles": st.integers(1, 10**6),
            "pf_err": st.floats(1e-6, 1.0),
            "pf_z": st.floats(0.0, 7.0),
            "recovery_alpha_slow": st.floats(0.0, 1.0),
            "recovery_alpha_fast": st.floats(0.0, 1.0),
            "update_min_d": st.floats(0.0, 1e3),
            "laser_model_type": st.sampled_from(["beam", "likelihood_field_prob"]),
            "robot_model_type": st.sampled_from(["differential", "omnidirectional", "x"]),
        },
    )
)
def test_whatever_amcl_may_be_told_makes_a_filter(tmp_path_factory, values):  # type: ignore[no-untyped-def]
    path = tmp_path_factory.mktemp("amcl") / "amcl.yaml"
    path.write_text(ros2(**values, tf_broadcast="true", alpha6=1), encoding="utf-8")
    entries, _ = read_nav2(path)
    config = RunConfig(map="m", log="l", **entries)
    config.composition.build(wall())
    assert config.policy.distance == values.get("update_min_d", 0.25)


@given(st.text() | st.binary().map(lambda raw: raw.decode("latin-1")))
def test_any_file_is_read_or_refused(tmp_path_factory, text):  # type: ignore[no-untyped-def]
    path = tmp_path_factory.mktemp("fuzz") / "amcl.yaml"
    path.write_text(text, encoding="utf-8", errors="replace")
    with suppress(McLocError):
        read_nav2(path)


@pytest.mark.parametrize("model", ["likelihood_field", "likelihood_field_prob", "beam"])
def test_it_localizes(read: Read, model: str) -> None:
    drive = office_drive(seed=3, length=15.0)
    entries, _ = read(DEFAULTS.replace('"likelihood_field"', model))
    config = RunConfig(**merged(entries, {"map": "m", "log": "l", "seed": 1}))
    localizer = Localizer(
        drive.grid,
        config.composition,
        seed=config.seed,
        initial=drive.truth.poses[0],
        policy=config.policy,
    )
    estimates = list(localizer.run(drive.events))
    found = np.array([estimate.pose for estimate in estimates])
    true = drive.truth.at(np.array([estimate.t for estimate in estimates]))
    errors = np.hypot(*(found - true)[:, :2].T)
    assert len(estimates) > 20
    assert np.median(errors) < 0.1
    assert errors.max() < 0.5
