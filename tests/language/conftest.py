"""Folders with diagrams in them."""

from pathlib import Path

import pytest

from tests.language.files import BASE, INNER, OUTER, write


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A folder with base.yaml, which is the current one."""
    monkeypatch.chdir(tmp_path)
    Path("base.yaml").write_text(BASE)
    return tmp_path


@pytest.fixture
def nested(folder):
    write("sub/inner.yaml", INNER)
    write("outer.yaml", OUTER)
