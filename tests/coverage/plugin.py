"""What pytest's processes do in a measured run: each test is a context, and each window counts its script."""

import os
from collections.abc import Iterator
from pathlib import Path

import pytest
from coverage import Coverage

from tests.coverage import page, python


def pytest_configure() -> None:
    if folder := os.environ.get(page.VARIABLE):
        page.count_in_windows(Path(folder))


@pytest.hookimpl(wrapper=True, tryfirst=True)
def pytest_runtest_protocol(item: pytest.Item) -> Iterator[None]:
    """Of the Python that runs in this process, and in those that the test starts."""
    measured = Coverage.current()
    os.environ[python.TEST] = item.nodeid
    if measured:
        measured.switch_context(item.nodeid)
    try:
        return (yield)
    finally:
        if measured:
            measured.switch_context("")
        del os.environ[python.TEST]
