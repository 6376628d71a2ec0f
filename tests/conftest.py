"""What all tests share: where the real data lie."""

import os
from pathlib import Path

import pytest
from hypothesis import settings

settings.register_profile("seatrial", deadline=None)  # the first call of a kernel compiles it
settings.load_profile("seatrial")


@pytest.fixture(scope="session")
def data() -> Path:
    """Folder of real glider logs; tests that need it are skipped where there is none."""
    folder = os.environ.get("SEATRIAL_DATA")
    if not folder:
        pytest.skip("real glider logs not at hand: set SEATRIAL_DATA to their folder")
    return Path(folder)
