"""The diagrams of FMUs that the README shows: the same bits as the native formation over the paper's 30 s."""

from __future__ import annotations

import shutil
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from cosim.engine import run
from cosim.export.exporter import export_fmu
from cosim.results import result_file

DIAGRAMS = Path(__file__).parents[2] / "diagrams"
STACK = ["observer", "differentiator", "topology", "potential_field", "controller"]


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A copy of the diagrams in which FMUs are made."""
    path = tmp_path_factory.mktemp("formation") / "diagrams"
    shutil.copytree(DIAGRAMS, path, ignore=shutil.ignore_patterns("*.fmu"))
    return path


@pytest.fixture(scope="module")
def recorded(folder):
    """Run a diagram of the folder, and return what it recorded and its outcome."""

    @cache
    def record(name: str, swaps: tuple[str, ...] = (), settings: tuple[str, ...] = ()):
        output = folder / "results" / f"{abs(hash((name, swaps, settings)))}.nc"
        outcome = run.Run(run.load(folder / name, settings, swaps), output=output).execute()
        assert outcome.status == "completed", outcome.error
        with result_file.open_result(output) as result:
            return {signal: result[signal] for signal in result.signals}

    return record


def assert_same(got: dict[str, np.ndarray], expected: dict[str, np.ndarray]) -> None:
    common = set(got) & set(expected)
    assert len(common) >= 8
    for signal in common:
        assert got[signal].shape == expected[signal].shape
        assert got[signal].tobytes() == expected[signal].tobytes(), signal


@pytest.mark.parametrize("version", ["2.0", "3.0"])
def test_the_finite_time_observer_alone_and_with_other_blocks_of_states(recorded, folder, version):
    """As Co-Simulation: all their outputs are states."""
    swaps = []
    for block in ("observer", "plant", "differentiator"):
        path = export_fmu(
            run.load(folder / "oft_observer.yaml"), [block], folder / f"{block}_{version[0]}.fmu", version
        )
        swaps.append(f"{block}={path}")
        assert_same(recorded("oft_observer.yaml", tuple(swaps)), recorded("oft_observer.yaml"))


def test_the_whole_control_stack_as_one_fmu(recorded, folder):
    export_fmu(run.load(folder / "formation.yaml"), STACK, folder / "fmus" / "stack.fmu", "3.0")
    for mode in ("co-simulation", "model-exchange"):
        got = recorded("fmus/control_stack.yaml", (), (f"blocks.stack.mode={mode}",))
        assert_same(got, recorded("formation.yaml"))


def test_robots_that_are_fmus_and_a_mixed_fleet(recorded, folder):
    export_fmu(run.load(folder / "formation.yaml"), ["plant"], folder / "fmus" / "robot.fmu")
    export_fmu(run.load(folder / "formation.yaml"), ["plant"], folder / "fmus" / "sixth.fmu", member=6)
    expected = recorded("formation.yaml")
    assert_same(recorded("fmus/plant.yaml"), expected)
    mixed = recorded("fmus/mixed_fleet.yaml", (), ("record.signals=[plant.x, sixth.x, controller.u, formation.S]",))
    assert mixed["plant.x"].tobytes() == np.ascontiguousarray(expected["plant.x"][:, :5]).tobytes()
    assert mixed["sixth.x"].tobytes() == np.ascontiguousarray(expected["plant.x"][:, 5]).tobytes()
    assert mixed["controller.u"].tobytes() == expected["controller.u"].tobytes()
