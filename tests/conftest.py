"""What all tests have: plain `assert` of helpers shows values too, and fixtures of the session."""

from __future__ import annotations

import pytest

pytest.register_assert_rewrite("helpers")


@pytest.fixture(scope="session")
def libfclib(tmp_path_factory):
    """Return how to ask libfclib what it reads from a file, or skip where it is not installed."""
    from helpers.libfclib import built

    return built(tmp_path_factory.mktemp("libfclib"))
