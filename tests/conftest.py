"""Fixtures that tests of several rooms share."""

import os
from pathlib import Path

import pytest
from hypothesis import settings

settings.register_profile("kernels", deadline=None)  # the first example compiles them
settings.load_profile("kernels")


@pytest.fixture(scope="session")
def data_dir() -> Path:
    """The folder of recorded logs, maps and references that MCLOC_DATA names."""
    named = os.environ.get("MCLOC_DATA")
    if named:
        folder = Path(named)
        assert folder.is_dir(), f"MCLOC_DATA={named} is no folder"
        return folder
    reason = "MCLOC_DATA does not name the folder of recorded logs"
    if os.environ.get("CI"):
        pytest.fail(f"{reason}, and CI must have it")
    pytest.skip(reason)
