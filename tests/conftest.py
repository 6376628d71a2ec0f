"""What all tests share: where the real data lie, and that a skip is a failure where SEATRIAL_NO_SKIP is set."""

import os
from collections.abc import Generator
from pathlib import Path
from typing import TypeVar

import pytest
from hypothesis import settings

Report = TypeVar("Report", pytest.TestReport, pytest.CollectReport)

settings.register_profile("seatrial", deadline=None)  # the first call of a kernel compiles it
settings.load_profile("seatrial")


@pytest.fixture(scope="session")
def data() -> Path:
    """Folder of real glider logs; tests that need it are skipped where there is none."""
    folder = os.environ.get("SEATRIAL_DATA")
    if not folder:
        pytest.skip("real glider logs not at hand: set SEATRIAL_DATA to their folder")
    return Path(folder)


def _refuse_skip(report: Report) -> Report:
    """Turn a skip into a failure if SEATRIAL_NO_SKIP is set."""
    if os.environ.get("SEATRIAL_NO_SKIP") and report.skipped and not hasattr(report, "wasxfail"):
        reason = report.longrepr[2] if isinstance(report.longrepr, tuple) else report.longrepr
        report.outcome = "failed"
        report.longrepr = f"{report.nodeid} may not be skipped here. {reason}"
    return report


@pytest.hookimpl(wrapper=True, tryfirst=True)
def pytest_runtest_makereport() -> Generator[None, pytest.TestReport, pytest.TestReport]:
    """See that every test is run."""
    return _refuse_skip((yield))


@pytest.hookimpl(wrapper=True, tryfirst=True)
def pytest_make_collect_report() -> Generator[None, pytest.CollectReport, pytest.CollectReport]:
    """See that every module of tests is run."""
    return _refuse_skip((yield))
