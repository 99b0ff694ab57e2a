"""What somebody says about a pose: a density, or an error on one line."""

import numpy as np
import pytest

from mcloc.density import Gaussian
from mcloc.errors import ConfigError

POSE = (1.0, 2.0, 0.5)
SURE = np.diag([0.1, 0.1, 0.1])


@pytest.mark.parametrize(
    ("pose", "covariance", "message"),
    [
        ("abc", SURE, "three finite numbers"),
        ([1.0, [2.0]], SURE, "three finite numbers"),
        (["1", "2", "3"], SURE, "three finite numbers"),
        (None, SURE, "three finite numbers"),
        (np.array(POSE) + 1j, SURE, "three finite numbers"),
        (np.zeros((40, 3)), SURE, "three finite numbers"),
        (POSE, "abc", r"\(3, 3\), finite"),
        (POSE, [[1.0], [1.0, 2.0]], r"\(3, 3\), finite"),
        (POSE, SURE * 1j, r"\(3, 3\), finite"),
        (POSE, SURE - 1.0, r"positive definite, got \[\[-0\.9, -1\.0, -1\.0\], \["),
        (POSE, np.diag([1e10, 1.0, 1.0]), r"deviations up to 10000 m and 2π rad"),
        (POSE, [[1e8, 1e7, 0.0], [1e7, 1e8, 0.0], [0.0, 0.0, 1.0]], "deviations up to"),
        (POSE, np.diag([1.0, 1.0, 40.0]), "deviations up to"),
    ],
)
def test_what_cannot_be_is_refused_on_one_line(pose, covariance, message):  # type: ignore[no-untyped-def]
    with pytest.raises(ConfigError, match=message) as caught:
        Gaussian.told("pose", pose, covariance)
    assert len(str(caught.value).splitlines()) == 1
    assert len(str(caught.value)) < 250


def test_the_widest_that_can_be_is_taken() -> None:
    deviations = np.array([1e4, 1e4, 2.0 * np.pi])
    told = Gaussian.told("pose", [1, 2, 0], np.diag(deviations**2))
    np.testing.assert_array_equal(told.mean, [1.0, 2.0, 0.0])
