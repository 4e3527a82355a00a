"""What tests of commands share."""

import pytest


@pytest.fixture
def elsewhere(tmp_path, monkeypatch):
    """Commands run in an empty folder, on a terminal of 80 columns."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "80")
