"""One short drive for all tests of the simulator."""

import pytest

from mcloc.simulation import SimulatedDrive, office_drive


@pytest.fixture(scope="session")
def drive() -> SimulatedDrive:
    return office_drive(seed=3, length=15.0)
