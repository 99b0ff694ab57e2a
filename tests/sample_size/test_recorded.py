"""Sizes that were noted: their file, and a run by the clock that is repeated to the last bit.

The robot of the run drives ahead and sees where it is; at one step its wheels count the wrong way,
so that the step is drawn again in doubt.
"""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mcloc.density import Gaussian
from mcloc.draws import Draws
from mcloc.errors import ConfigError
from mcloc.filters.particle_filter import Part, ParticleFilter
from mcloc.filters.recovery import NoRandomParticles
from mcloc.motion import OdometryMotion
from mcloc.proposals.forward import Forward
from mcloc.resampling import RESAMPLERS
from mcloc.sample_size import Recorded, TimeBudget, sizes_csv
from mcloc.sample_size.recorded import read_sizes
from mcloc.statespace import LINE


class Beacon:
    """z: (2,) where the robot is, in metres, to 0.2 m."""

    def log_likelihood(self, x, z):
        return -0.5 * (np.hypot(x[0] - z[0], x[1] - z[1]) / 0.2) ** 2

    def source(self, z):
        return "beacon"

    def readings(self, z):
        return 1.0


class Everywhere:
    def log_prior(self, x):
        return np.zeros(x.shape[1])


def run(size, resampler, steps=6, lies_at=4):
    """Beliefs and infos of a drive, and the sizes of all sets that were drawn."""
    part = Part(1.0, Forward(RESAMPLERS.make(resampler)), size)
    robot = ParticleFilter(OdometryMotion(), Beacon(), Everywhere(), (part,), NoRandomParticles())
    bel = robot.start(Gaussian(np.zeros(3), np.diag([0.1, 0.1, 0.1]) ** 2), Draws(5, 0))
    beliefs, infos, sizes = [bel], [], [(0, 0, len(bel.particles))]
    for step in range(1, steps + 1):
        u = np.array([-0.5 if step == lies_at else 0.5, 0.0, 0.0])
        bel, info = robot.step(bel, u, np.array([0.5 * step, 0.0]), Draws(5, step))
        beliefs.append(bel)
        infos.append(info)
        sizes += [(step, nth, n) for nth, n in enumerate(info.sizes)]
    return beliefs, infos, sizes


class RandomClock:
    """Each look at it finds it a random time later."""

    def __init__(self):
        self.now, self.rng = 0.0, np.random.default_rng(3)

    def __call__(self):
        self.now += self.rng.exponential(0.02)
        return self.now


LIMITS = {"minimum": 600, "maximum": 20_000}
CLOCKS = {
    "set by the test": lambda: TimeBudget(budget=0.05, clock=RandomClock(), **LIMITS),
    "of the machine": lambda: TimeBudget(budget=0.0005, **LIMITS),
}


@pytest.mark.parametrize("resampler", [r for r in RESAMPLERS if r != "residual"])
@pytest.mark.parametrize("clock", CLOCKS)
def test_a_run_by_the_clock_is_repeated_to_the_last_bit(tmp_path, clock, resampler):
    beliefs, infos, sizes = run(CLOCKS[clock](), resampler)
    file = tmp_path / "sizes.csv"
    file.write_text(sizes_csv(sizes))
    again = run(Recorded(str(file)), resampler)
    assert again[1:] == (infos, sizes)
    for a, b in zip(beliefs, again[0], strict=True):
        assert a.particles.states.tobytes() == b.particles.states.tobytes()
        assert a.particles.log_weights.tobytes() == b.particles.log_weights.tobytes()
    assert (4, 1) in read_sizes(str(file)), "the lie was believed: the test shows too little"
    if clock == "set by the test" and resampler != "selective":
        assert len({n for _, _, n in sizes}) > 3


def test_other_sizes_are_another_run(tmp_path):
    """The test above would notice."""
    beliefs, _, sizes = run(CLOCKS["set by the test"](), "systematic")
    file = tmp_path / "sizes.csv"
    file.write_text(sizes_csv([(step, nth, n + 1) for step, nth, n in sizes]))
    again, _, _ = run(Recorded(str(file)), "systematic")
    n = len(beliefs[-1].particles)
    assert not np.array_equal(beliefs[-1].particles.states, again[-1].particles.states[:, :n])


@given(
    st.dictionaries(
        st.tuples(st.integers(0, 10**6), st.integers(0, 5)), st.integers(1, 10**7), min_size=1
    )
)
def test_what_is_written_is_read(tmp_path_factory, sizes):
    file = tmp_path_factory.mktemp("sizes") / "sizes.csv"
    file.write_text(sizes_csv((float(step), nth, n) for (step, nth), n in sizes.items()))
    assert read_sizes(str(file)) == sizes


@pytest.mark.parametrize("chunk", [1, 7, 500])
def test_drawing_stops_at_the_exact_index_whatever_the_chunk(tmp_path, chunk):
    file = tmp_path / "sizes.csv"
    file.write_text("step,nth,n\n0,0,100\n3,1,42\n")
    rule = Recorded(str(file))
    assert rule.fixed is None
    counter, done, enough = rule.counter(LINE, 3, 1), 0, None
    while enough is None:
        enough = counter.enough(np.zeros((1, chunk)), np.zeros(chunk))
        done += chunk
    assert done - chunk + enough == 42


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "holds no sizes"),
        ("step,nth,n\n", "holds no sizes"),
        ("t,x,y\n1,2,3\n", "line 1: not the header"),
        ("step,nth,n\n1,0,5\n1,0\n", "line 3: not step,nth,n"),
        ("step,nth,n\n1,0,5\n\n", "line 3: not step,nth,n"),
        ("step,nth,n\n1,0,many\n", "line 2: not step,nth,n"),
        ("step,nth,n\n1,0,-5\n", "line 2: not step,nth,n"),
        ("step,nth,n\n1,0,2.5\n", "line 2: not step,nth,n"),
        ("step,nth,n\n1,0,0\n", "line 2: not step,nth,n"),
        ("step,nth,n\n1,0,²\n", "line 2: not step,nth,n"),
        ("step,nth,n\n1,0,999999999\n", "line 2: not step,nth,n"),
        ("step,nth,n\n1,0,5\n2,0,5\n1,0,6\n", "line 4: a second size for step 1, set 0"),
    ],
)
def test_a_bad_file_is_refused_by_name_and_line(tmp_path, text, message):
    file = tmp_path / "sizes.csv"
    file.write_text(text)
    with pytest.raises(ConfigError, match=message) as raised:
        Recorded(str(file))
    assert str(file) in str(raised.value)
    assert "\n" not in str(raised.value)


def test_a_missing_file_is_refused(tmp_path):
    with pytest.raises(ConfigError, match=r"nowhere\.csv: cannot be opened"):
        Recorded(str(tmp_path / "nowhere.csv"))


def test_no_file_is_refused():
    with pytest.raises(ConfigError, match=r"file must name the sizes\.csv"):
        Recorded()


def test_a_set_of_which_the_file_says_nothing_is_refused(tmp_path):
    file = tmp_path / "sizes.csv"
    file.write_text("step,nth,n\n0,0,100\n1,0,42\n")
    with pytest.raises(ConfigError, match=r"sizes\.csv: holds no size for step 1, set 1"):
        Recorded(str(file)).counter(LINE, 1, 1)
