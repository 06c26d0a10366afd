"""Blocks of the library, exported with their sources of signals: the FMU gives the bits of the diagram."""

import numpy as np
import pytest

from cosim.engine import run
from cosim.export.exporter import export_fmu
from cosim.results.result_file import open_result
from tests.blocks.library_diagrams import write

RUN = "run: {stop: 0.5, step: 0.01, integrator: rk4}\n"


def results(path, names):
    """Signals of a diagram at every step, by what stands behind the name of the block or of the FMU."""
    outcome = run.Run(run.load(path), output=path.with_suffix(".nc")).execute()
    assert outcome.status == "completed"
    with open_result(path.with_suffix(".nc")) as result:
        return [np.array(result[name]) for name in names]


@pytest.mark.parametrize("version", ["2.0", "3.0"])
@pytest.mark.parametrize(("file", "variant"), [("nonlinear", "scalar"), ("pid", "vector"), ("logic", "fleet")])
def test_exported_blocks_give_the_same_bits(tmp_path, file, variant, version):
    path, signals = write(tmp_path, file, variant)
    network = run.load(path)
    outputs = [s for s in signals if _causality(network, s) == "output"]
    path.write_text(path.read_text() + f"record: {{signals: [{', '.join(outputs)}]}}\n")
    fmu = export_fmu(network, [], tmp_path / "all.fmu", version)
    other = tmp_path / "f.yaml"
    named = ", ".join(f"f.{s}" for s in outputs)
    other.write_text(f"{RUN}blocks:\n  f: {{fmu: {fmu}}}\nrecord: {{signals: [{named}]}}\n")
    for name, own, found in zip(
        outputs, results(path, outputs), results(other, [f"f.{s}" for s in outputs]), strict=True
    ):
        np.testing.assert_array_equal(own.reshape(len(own), -1), found.reshape(len(found), -1), err_msg=name)


def _causality(network, signal):
    name, variable = signal.split(".")
    return network.components[name].declaration.variables[variable].causality
