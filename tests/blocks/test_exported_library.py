"""Every block of the library, exported with its sources of signals: the FMU gives the bits of the diagram.

One FMU a file and version, of all blocks in it; shapes take turns. Steps and periods are powers of two: an importer may
not set an FMU's clock beyond its next sample, which `time + step` is by a rounding error where step is 0.01.
"""

import numpy as np
import pytest

from cosim.engine import run
from cosim.export.exporter import export_fmu
from cosim.results.result_file import open_result
from tests.blocks.library_diagrams import FILES, VARIANTS, blocks_of, write

VERSIONS = ("2.0", "3.0")
CASES = [
    (file, list(VARIANTS)[(i + k) % len(VARIANTS)], version)
    for i, file in enumerate(FILES)
    for k, version in enumerate(VERSIONS)
]
RUN = "run: {stop: 0.5, step: 0.0078125, integrator: rk4, method: %s}\n"
METHODS = {"co-simulation": "jacobi", "model-exchange": "joint"}


def results(path, names, method):
    """Signals of a diagram at every step, a row each."""
    outcome = run.Run(run.load(path, [f"run.method={method}"]), output=path.with_suffix(".nc")).execute()
    assert outcome.status == "completed"
    with open_result(path.with_suffix(".nc")) as result:
        return [(values := np.array(result[name])).reshape(len(values), -1) for name in names]


@pytest.mark.parametrize(("file", "variant", "version"), CASES)
def test_exported_blocks_give_the_same_bits(tmp_path, file, variant, version):
    path, signals = write(tmp_path, file, variant)
    network = run.load(path)
    outputs = [s for s in signals if _causality(network, s) == "output"]
    path.write_text(path.read_text() + f"record: {{signals: [{', '.join(outputs)}]}}\n")
    fmu = export_fmu(network, [], tmp_path / "all.fmu", version)
    for mode, method in METHODS.items():
        other = tmp_path / f"{mode}.yaml"
        named = ", ".join(f"f.{s}" for s in outputs)
        head = RUN % method
        other.write_text(f"{head}blocks:\n  f: {{fmu: {fmu}, mode: {mode}}}\nrecord: {{signals: [{named}]}}\n")
        own, found = results(path, outputs, method), results(other, [f"f.{s}" for s in outputs], method)
        for name, expected, values in zip(outputs, own, found, strict=True):
            assert len(values) == len(expected) == 65
            np.testing.assert_array_equal(values, expected, err_msg=f"{name} as {mode}")


def _causality(network, signal):
    name, variable = signal.split(".")
    return network.components[name].declaration.variables[variable].causality


def test_sources_that_begin_later_go_on_as_if_they_had_begun_at_zero(tmp_path):
    path, _ = write(tmp_path, "sources", "scalar")
    network = run.load(path)
    names = [f"{name}.y" for name in blocks_of("sources") if name in network.components]
    path.write_text(path.read_text() + f"record: {{signals: [{', '.join(names)}]}}\n")
    fmu, skipped = export_fmu(network, [], tmp_path / "all.fmu"), 13  # 0.1015625 s: within a table and a pulse
    for mode, method in METHODS.items():
        later = tmp_path / f"{mode}.yaml"
        head = RUN.replace("0.5", "0.3984375") % method
        block = f"{{fmu: {fmu}, mode: {mode}, start_time: 0.1015625}}"
        signals = [f"f.{name}" for name in names]
        later.write_text(f"{head}blocks:\n  f: {block}\nrecord: {{signals: [{', '.join(signals)}]}}\n")
        own, found = results(path, names, method), results(later, signals, method)
        for name, expected, values in zip(names, own, found, strict=True):
            np.testing.assert_array_equal(values, expected[skipped:], err_msg=f"{name} as {mode}")
