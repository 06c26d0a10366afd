"""What an FMU breaks, breaks only its own process: the run ends with a message, an exit code, and what was recorded.

Each fault is met by the command line, in the loop's process and isolated, with FMI 2 and 3.
"""

from __future__ import annotations

import json
import re
import time
import zipfile
from pathlib import Path

import numpy as np
import pytest

from cosim.machine import supervision
from cosim.results import result_file
from cosim.terminal import cli
from tests.fmu import machine

DISCARD, ERROR, NAN, SEGFAULT, HANG, ABORT, EXIT, CLOSE = 1, 2, 4, 9, 10, 12, 13, 14
IN_EXIT_INITIALIZATION, IN_TERMINATE, IN_FREE = 100, 200, 300
DIAGRAM = """
run: {{stop: 1, step: 0.01, patience: {patience}}}
fleets: {{robot: 2}}
blocks:
  source: {{type: Source}}
  {name}:
    fmu: {fmu}
    isolate: {isolated}
    per: robot
    inputs: {{u: source.u}}
    parameters: {{fault: [0, {fault}], fault_time: 0.5, name: [Ann, Bob]}}
record: {{period: 0.01, signals: [{name}.x, source.u]}}
"""

pytestmark = pytest.mark.skipif(not supervision.AVAILABLE, reason="needs fork")
isolation = pytest.mark.parametrize("isolated", ["false", "true"])


class Told:
    """What a person gets from a run that stopped."""

    def __init__(self, code: int, out: str, err: str, output: Path) -> None:
        self.code, self.err = code, err
        self.json = json.loads(out)
        self.text = re.sub(r"\s+", " ", self.json["error"])
        with result_file.open_result(output) as result:
            self.status = result.attrs["status"]
            self.times = np.array(result.times)
            self.signals = {name: np.array(result[name]) for name in ("source.u",)}


@pytest.fixture
def told(partners, tmp_path, capfd):
    """Run a diagram by the command line."""

    def run(text: str, *arguments: str) -> Told:
        output = tmp_path / "result.nc"
        capfd.readouterr()
        code = cli.main(["run", str(partners(text)), "--json", "-o", str(output), *arguments])
        out, err = capfd.readouterr()
        assert "Traceback" not in err
        assert not re.search(r"^(Fatal Python error|Segmentation fault|Aborted)", err, re.MULTILINE)
        assert code == 1
        return Told(code, out, err, output)

    return run


class Clock:
    """The watch's time: it begins when the machine hangs, so that nothing depends on how fast this one is."""

    sleep = staticmethod(time.sleep)

    def __init__(self, hangs: Path) -> None:
        self._hangs = hangs
        self._began = 0.0

    def monotonic(self) -> float:
        if not self._began and self._hangs.exists():
            self._began = time.monotonic()
        return time.monotonic() - self._began if self._began else 0.0


@pytest.fixture
def hanging(monkeypatch, tmp_path):
    """The patience is over soon after the machine hangs, and never before."""
    hangs = tmp_path / "hangs"
    monkeypatch.setenv("MACHINE_HANGS", str(hangs))
    monkeypatch.setattr(supervision, "time", Clock(hangs))


def diagram(fmu: Path, fault: int, isolated: str = "false", patience: float = 10.0, name: str = "plant") -> str:
    return DIAGRAM.format(fmu=fmu, fault=fault, isolated=isolated, patience=patience, name=name)


@isolation
@pytest.mark.parametrize("kind", ["2", "3", "3e"])
@pytest.mark.parametrize(
    ("fault", "words"),
    [
        (SEGFAULT, "segmentation fault in fmi{}DoStep()"),
        (ABORT, "abort() in fmi{}DoStep()"),
        (EXIT, "exit() with code 3 in fmi{}DoStep()"),
        (DISCARD, "fmi{}DoStep() returned `discard`"),
        (ERROR, "fmi{}DoStep() returned `error`"),
        (NAN, "it gave a value that is not finite: `x`"),
    ],
)
def test_a_fault_in_a_step_ends_the_run_with_its_data(told, machines, fault, words, kind, isolated):
    end = told(diagram(machines[kind], fault, isolated))
    assert f"block plant (machine{kind[0]}.fmu, robot 2) failed at t = 0.5 s: {words.format(kind[0])}" in end.text
    assert end.json["status"] == end.status == "failed"
    expected = 50 if fault == NAN else 51
    assert len(end.times) == expected
    assert np.allclose(end.times, 0.01 * np.arange(expected), atol=1e-12)
    sines = np.sin(3.0 * end.times)
    assert np.all(np.abs(end.signals["source.u"] - sines) <= 2.0 * np.spacing(sines))  # each within 1 ulp


@isolation
def test_an_fmu_that_closes_all_files_is_found_out(told, machines, isolated):
    """The loop goes on for a moment: what breaks is the pipe to this process."""
    end = told(diagram(machines["2"], CLOSE, isolated))
    assert "block plant (machine2.fmu, robot 2) failed at t = " in end.text
    assert "it closed files that are not its own" in end.text
    assert end.status == "failed" and len(end.times) >= 51


@isolation
def test_the_last_words_of_an_fmu_outlive_it(told, machines, isolated):
    assert (
        "it says warning: a bad feeling at 0.5, in state 4 (Bob)"
        in told(diagram(machines["2"], SEGFAULT, isolated)).text
    )


@isolation
@pytest.mark.parametrize("kind", ["2", "3"])
def test_an_endless_step_is_ended(told, machines, kind, isolated, hanging):
    end = told(diagram(machines[kind], HANG, isolated, patience=0.3))
    assert f"robot 2) failed at t = 0.5 s: no answer for 0.3 s in fmi{kind}DoStep()" in end.text
    assert "run.patience" in end.text
    assert len(end.times) == 51


@isolation
@pytest.mark.parametrize(
    ("fault", "words"),
    [(SEGFAULT, "segmentation fault in"), (HANG, "no answer for 0.3 s in"), (EXIT, "exit() with code 3 in")],
)
def test_a_fault_in_initialization_is_named(told, machines, fault, words, isolated, hanging):
    end = told(diagram(machines["2"], IN_EXIT_INITIALIZATION + fault, isolated, patience=0.3))
    assert f"block plant (machine2.fmu, robot 2) failed at t = 0 s: {words} fmi2ExitInitializationMode()" in end.text
    assert (end.status, len(end.times)) == ("failed", 0)


@isolation
def test_a_crash_in_instantiation_is_named(told, machines, isolated):
    text = diagram(machines["2"], 0, isolated, name="crash").replace("per: robot\n", "\n").replace("[0, 0]", "0")
    end = told(text.replace(", name: [Ann, Bob]", ""))
    assert "block crash (machine2.fmu) failed at t = 0 s: segmentation fault in fmi2Instantiate()" in end.text


@isolation
@pytest.mark.parametrize(("place", "function"), [(IN_TERMINATE, "Terminate"), (IN_FREE, "FreeInstance")])
def test_a_crash_at_the_end_keeps_everything(told, machines, place, function, isolated):
    end = told(diagram(machines["3"], place + SEGFAULT, isolated))
    assert f"robot 2) failed at t = 1 s: segmentation fault in fmi3{function}()" in end.text
    assert (end.status, len(end.times)) == ("failed", 101)


def test_the_interpreted_engine_survives_as_well(told, machines):
    end = told(diagram(machines["2"], SEGFAULT), "--engine", "python")
    assert "failed at t = 0.5 s: segmentation fault in fmi2DoStep()" in end.text
    assert len(end.times) == 51


# ---- descriptions that lie ----


def edited(folder: Path, version: int, pattern: str, replacement: str) -> Path:
    def edit(xml: str) -> str:
        changed, count = re.subn(pattern, replacement, xml)
        assert count
        return changed

    return machine.build(folder, version, "cs", edit=edit)


@isolation
@pytest.mark.parametrize(
    ("version", "pattern", "replacement", "words"),
    [
        (2, r'valueReference="2"', 'valueReference="999"', r"fmi2GetReal\(\) for `x` returned `error`"),
        (3, '="6"', '="999"', r"fmi3GetFloat64\(\) for `h` returned `error`"),
        (3, r'(name="twice".*?)start="3"', r'\1start="4"', r"fmi3GetFloat64\(\) for `twice` returned `error`"),
        # How far an FMU reads before it faults is up to the heap.
        (
            3,
            r'(name="twice".*?)start="3"',
            r'\1start="3000000"',
            r"(segmentation fault in fmi3GetFloat64\(\)|fmi3GetFloat64\(\) for `twice` returned `error`)",
        ),
    ],
)
def test_a_description_that_lies_about_sizes(told, tmp_path, version, pattern, replacement, words, isolated):
    path = edited(tmp_path / "liar", version, pattern, replacement)
    recorded = "plant.twice" if "twice" in pattern else "plant.h" if version == 3 else "plant.x"
    text = diagram(path, 0, isolated).replace("signals: [plant.x", f"signals: [{recorded}")
    end = told(text.replace("per: robot\n", "\n").replace("[0, 0]", "0").replace(", name: [Ann, Bob]", ""))
    assert re.search(rf"block plant \(machine{version}.fmu\) failed at t = 0 s: {words}", end.text)
    assert end.status == "failed"


# ---- files that are no FMU ----


def without_binary(path: Path) -> bytes:
    with zipfile.ZipFile(path) as archive:
        description = archive.read("modelDescription.xml")
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("modelDescription.xml", description)
        archive.writestr("binaries/win64/machine.dll", b"MZ")
    return path.read_bytes()


def with_escape(path: Path) -> bytes:
    with zipfile.ZipFile(path, "a") as archive:
        archive.writestr("../escaped.txt", "x")
    return path.read_bytes()


@pytest.mark.parametrize(
    ("spoil", "words"),
    [
        (without_binary, "has no binary `machine.so`"),
        (lambda path: path.read_bytes()[: path.stat().st_size // 2], "is no sound FMU archive"),
        (with_escape, "`../escaped.txt` would be written outside of its folder"),
    ],
    ids=["missing binary", "truncated", "escaping"],
)
def test_a_file_that_is_no_sound_fmu_is_bad_input(machines, partners, tmp_path, capfd, spoil, words):
    path = tmp_path / "inner" / "machine2.fmu"
    path.parent.mkdir()
    path.write_bytes(machines["2"].read_bytes())
    path.write_bytes(spoil(path))
    code = cli.main(["run", str(partners(diagram(path, 0))), "-o", str(tmp_path / "result.nc")])
    err = re.sub(r"\s+", " ", capfd.readouterr().err)
    assert code == 2
    assert words in err and "machine2.fmu" in err and "Traceback" not in err
    assert not list(tmp_path.rglob("escaped.txt"))


def test_what_an_fmu_prints_does_not_mix_with_json(told, tmp_path):
    """Standard output is the run's alone; what is printed inside an FMU goes to standard error."""
    source = machine.SOURCE.read_text().replace(
        "misbehave(m->fault);", 'puts("hello from inside"); misbehave(m->fault);'
    )
    changed = tmp_path / "machine.c"
    changed.write_text(source)
    before, machine.SOURCE = machine.SOURCE, changed
    try:
        path = machine.build(tmp_path / "talker", 2, "cs")
    finally:
        machine.SOURCE = before
    assert "hello from inside" in told(diagram(path, ERROR)).err


def test_a_crash_in_a_native_block_says_who_else_was_there(told, machines, tmp_path):
    (tmp_path / "breaker.py").write_text(
        "import os\nfrom cosim import Block, Output\n\n\n"
        "class Breaker(Block, compiled=False):\n    y = Output()\n\n"
        "    def outputs(time, y):\n        if time > 0.295:\n            os.abort()\n        y[0] = time\n"
    )
    text = diagram(machines["2"], 0).replace(
        "  source:", f"  breaker: {{python: {tmp_path}/breaker.py:Breaker}}\n  source:"
    )
    end = told(text)
    assert "block breaker: abort() in outputs() at t = 0.3 s" in end.text
    assert "to see whether plant did it, write `isolate: true` there" in end.text
    assert len(end.times) == 30


def test_only_the_time_inside_an_fmu_is_its_own(machines, partners):
    """What this program does itself, such as filling its tables for 100,000 outputs, is never taken for a hang."""
    from cosim.engine import run
    from cosim.engine.hosts import Watch
    from cosim.engine.run import Run
    from cosim.fmu import fields

    simulation = Run(run.load(partners(diagram(machines["2"], 0)))).simulation
    simulation.initialize()
    (part,) = simulation._parts["plant"]
    watch = Watch(simulation.program, simulation.control, simulation._parts)
    with watch.blaming(part):
        assert watch.activity() is None
        with part.trace.calling(0, 0):
            first = watch.activity()
            assert first is not None
            part.trace.link[fields.CALLED] += 2
            assert watch.activity() != first
        assert watch.activity() is None
    assert simulation.warnings() == []
    simulation.close()
