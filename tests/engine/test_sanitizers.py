"""The loop, kernels and the exported wrapper under AddressSanitizer and UBSan: nobody touches what is not theirs."""

from __future__ import annotations

import importlib.util
import os
import platform
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
LINUX = platform.system() == "Linux" and platform.machine() == "x86_64"
pytestmark = pytest.mark.skipif(
    not (LINUX and shutil.which("gcc") and importlib.util.find_spec("ziglang")),
    reason="needs gcc's sanitizers and zig's compiler on x86-64 Linux",
)
LOOP = """
run: {{stop: 0.6, step: 0.01, method: {method}, integrator: {integrator}, inner_steps: 2}}
fleets: {{robot: 3}}
blocks:
  source: {{type: Sine, per: robot, parameters: {{f: [1, 2, 3]}}}}
  lag: {{type: Lag, per: robot, parameters: {{T: "0.1 * i"}}, inputs: {{u: source.y}}, start: {{x: [0.5, "i"]}}}}
  filter: {{type: Lag, per: robot, inputs: {{u: ["lag.y[2..3]", "lag.y[1]"]}}}}
  average: {{type: Average, inputs: {{u: filter.x}}}}
  numbers: {{type: Numbers, inputs: {{k: ["average.number[3]", "average.number[1..2]"]}}}}
  probe: {{type: Oscillator}}
  counter: {{type: Counter, period: 0.03, inputs: {{u: probe.x}}}}
record: {{period: 0.01, signals: [lag.x, filter.y, average.number, numbers.y, counter.count]}}
metrics: {{largest: {{signal: lag.y, reduce: max}}}}
"""


@pytest.fixture(scope="module")
def code(tmp_path_factory):
    """A folder for watched code, which the tests share."""
    return tmp_path_factory.mktemp("code")


@pytest.fixture
def watched(code):
    """Run something in a process of its own, with the sanitizers' libraries; exit code and all that it says."""
    return lambda kind, path, *settings: run(code, kind, path, *settings)


def run(folder, kind, path, *settings):
    libraries = [
        subprocess.run(["gcc", f"-print-file-name={name}"], capture_output=True, text=True, check=True).stdout.strip()
        for name in ("libasan.so", "libubsan.so")
    ]
    environment = {
        **os.environ,
        "LD_PRELOAD": " ".join(libraries),
        "ASAN_OPTIONS": "detect_leaks=0",
        "PYTHONMALLOC": "malloc",
        "SANITIZED": str(folder),
    }
    command = [sys.executable, "-m", "tests.sanitized", kind, str(path), *settings]
    done = subprocess.run(command, cwd=ROOT, env=environment, capture_output=True, text=True, timeout=600, check=False)
    return done.returncode, done.stdout + done.stderr


@pytest.mark.parametrize("method", ["jacobi", "gauss-seidel", "joint"])
def test_no_method_touches_what_is_not_its_own(write, watched, method):
    code, said = watched("run", write(LOOP.format(method=method, integrator="rk4")))
    assert code == 0 and '"completed"' in said and "Sanitizer" not in said, said


@pytest.mark.parametrize("method", ["jacobi", "gauss-seidel", "joint"])
@pytest.mark.parametrize(
    "settings", [("rodas4", 2), ("rodas5p", 1, "run.tolerance=1e-5"), ("heun", 1, "run.tolerance=1e-4")]
)
def test_no_integrator_touches_what_is_not_its_own(write, watched, method, settings):
    integrator, inner_steps, *tolerance = settings
    path = write(LOOP.format(method=method, integrator=integrator))
    code, said = watched("run", path, f"run.inner_steps={inner_steps}", *tolerance)
    assert code == 0 and '"completed"' in said and "Sanitizer" not in said, said


def test_the_formation_touches_nothing_else(formation, watched):
    code, said = watched("run", formation, "run.stop=0.2", "record.period=0.001", "metrics={}")
    assert code == 0 and '"completed"' in said and "Sanitizer" not in said, said


def test_the_sanitizer_would_see_a_row_too_many(write, watched):
    """The guard of the guard: with room for a row more than there is, the next allocation would be overwritten."""
    code, said = watched("broken", write(LOOP.format(method="jacobi", integrator="euler")))
    assert code != 0 and "heap-buffer-overflow" in said, said


def test_an_exported_fmu_touches_nothing_else(write, watched):
    path = write(LOOP.format(method="gauss-seidel", integrator="rk4"))
    implicit = [
        f"blocks.{name}.{word}" for name in ("probe", "lag") for word in ("integrator=rodas5p", "tolerance=1e-5")
    ]
    code, said = watched("fmu", path, *implicit)
    assert code == 0 and "Sanitizer" not in said and "runtime error" not in said, said
