"""Fixtures: the test FMU of `machine.c`, built once a session, and diagrams around it."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.fmu import machine

PARTNERS = Path(__file__).with_name("partners.py")
EVENTFUL = 'hasEventMode="true" mightReturnEarlyFromDoStep="true"'


@pytest.fixture(scope="session")
def machines(tmp_path_factory):
    """The test FMU by kind: `2`, `3`, and `3e` with event mode."""
    folder = tmp_path_factory.mktemp("machines")
    kinds = {"2": (2, "me cs", ""), "3": (3, "me cs", ""), "3e": (3, "cs", EVENTFUL)}
    return {name: machine.build(folder / name, *arguments) for name, arguments in kinds.items()}


@pytest.fixture
def partners(write):
    """Write a diagram in which `type: Lag` is a block of `partners.py`."""

    def write_text(text: str) -> Path:
        return write(text.replace("type: ", f"python: {PARTNERS}:"))

    return write_text
