"""Every block of the library: it is documented, and gives the same bits compiled and interpreted, in every shape."""

import re

import numpy as np
import pytest

from cosim.authoring.variables import Indicator, Parameter, State
from cosim.engine import run
from cosim.wiring import library
from tests.blocks.library_diagrams import FILES, VARIANTS, blocks_of, write

NAMES = [name for file in FILES for name in blocks_of(file)]


@pytest.mark.parametrize("variant", VARIANTS)
@pytest.mark.parametrize("file", FILES)
def test_compiled_and_interpreted_give_the_same_bits(tmp_path, trajectories, file, variant):
    path, signals = write(tmp_path, file, variant)
    network = run.load(path)
    signals = [s for s in signals if not isinstance(_variable(s), Indicator)]
    native = trajectories(network, *signals)
    python = trajectories(network, *signals, engine="python")
    for signal in signals:
        assert native[signal].tobytes() == python[signal].tobytes(), signal
        if variant == "fleet" and _variable(signal).causality == "output":
            assert native[signal].shape[1] == 2, signal


def _variable(signal):
    name, variable = signal.split(".")
    return library.all_blocks()[name].declaration.variables[variable]


@pytest.mark.parametrize("name", NAMES)
def test_every_block_is_documented(name):
    declaration = library.all_blocks()[name].declaration
    summary, _, rest = declaration.doc.partition("\n\n")
    assert summary.endswith(".") and "\n" not in summary and len(summary) <= 116, "one line says what it is"
    assert re.search(r"::\n\n    \S", rest), "an equation"
    for variable in declaration.variables.values():
        assert variable.description, variable.name
        if isinstance(variable, Parameter | State) and variable.dtype == bool:
            assert variable.start is not None


@pytest.mark.parametrize("file", FILES)
def test_the_library_starts_without_a_single_parameter_that_could_have_a_default(file):
    needed = {
        name: [p.name for p in library.all_blocks()[name].declaration.of(Parameter) if p.start is None]
        for name in blocks_of(file)
    }
    matrices = {"K", "A", "B", "C", "table", "values", "times", "points_1", "points_2", "Q", "R", "L"}
    assert all(set(names) <= {*matrices, "seed"} for names in needed.values()), needed
    assert np.all([len(blocks_of(file)) > 0])
