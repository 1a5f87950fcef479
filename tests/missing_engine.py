"""Skips what needs PyBullet on Pythons for which it has no wheels; a plugin that conftest loads.

A test fails there with the line that evoros gives, in its error or in the output of a command.
Only such a failure is a skip, and only on Python 3.12 and later: on 3.11 it stays a failure.
"""

import sys
from collections.abc import Generator
from importlib.util import find_spec

import pytest

LINE = "PyBullet is not installed"
WITHOUT = sys.version_info >= (3, 12) and find_spec("pybullet") is None
REASON = f"needs PyBullet, which has no wheels for Python 3.{sys.version_info.minor}"


def _skip(report: pytest.CollectReport | pytest.TestReport) -> None:
    told = [str(report.longrepr), *(text for _, text in report.sections)]
    if WITHOUT and report.failed and any(LINE in text for text in told):
        report.outcome = "skipped"
        report.longrepr = (report.nodeid.partition("::")[0], 0, f"Skipped: {REASON}")


@pytest.hookimpl(wrapper=True)
def pytest_make_collect_report() -> Generator[None, pytest.CollectReport, pytest.CollectReport]:
    report = yield
    _skip(report)
    return report


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport() -> Generator[None, pytest.TestReport, pytest.TestReport]:
    report = yield
    _skip(report)
    return report
