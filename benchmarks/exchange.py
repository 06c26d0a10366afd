"""What exchanging values with FMUs costs: two trivial ones in a loop, each stepped with the other's last output.

    python benchmarks/exchange.py [--rounds 7] [--cc gcc]

The FMUs hand on their input plus one, a step later: after n steps both outputs are n, which is checked. The programs
take turns, so that whatever else the machine does meets all of them; ratios are of one round each.
"""

from __future__ import annotations

import argparse
import re
import subprocess
import tempfile
import time as clock
import zipfile
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import fmpy
import numpy as np
from fmpy.fmi2 import FMU2Slave, fmi2Real, fmi2ValueReference
from fmpy.fmi3 import FMU3Slave, fmi3Float64, fmi3ValueReference

from cosim import Block, Input, State
from cosim.engine import compilation, program, run
from cosim.engine.simulation import Simulation
from cosim.export import build
from cosim.export.exporter import export_fmu
from cosim.fmu import versions
from cosim.wiring.network import Signal

HERE = Path(__file__).resolve().parent
STEP, STEPS, FMPY_STEPS, ISOLATED_STEPS, TRIPS = 1e-3, 100_000, 10_000, 10_000, 10_000
CALLS = 4  # of cosim's adapter in a step: each FMU's outputs are got, then its inputs set and its step done

DIAGRAM = """
run: {{stop: {stop}, step: {step}}}
blocks:
  one: {{{one}, inputs: {{u: other.y}}}}
  other: {{{other}, inputs: {{u: one.y}}}}
"""
INTERFACE = '<CoSimulation modelIdentifier="relay"/>'
DESCRIPTIONS = {
    2: f"""<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="2.0" modelName="relay" guid="relay">{INTERFACE}<ModelVariables>
<ScalarVariable name="u" valueReference="0" causality="input"><Real start="0"/></ScalarVariable>
<ScalarVariable name="y" valueReference="1" causality="output" initial="exact"><Real start="0"/></ScalarVariable>
</ModelVariables><ModelStructure><Outputs><Unknown index="2" dependencies=""/></Outputs></ModelStructure>
</fmiModelDescription>""",
    3: f"""<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="3.0" modelName="relay" instantiationToken="relay">{INTERFACE}<ModelVariables>
<Float64 name="time" valueReference="2" causality="independent"/>
<Float64 name="u" valueReference="0" causality="input" start="0"/>
<Float64 name="y" valueReference="1" causality="output" initial="exact" start="0"/>
</ModelVariables><ModelStructure><Output valueReference="1" dependencies=""/></ModelStructure>
</fmiModelDescription>""",
}


class Relay(Block):
    """Hands on its input plus one, a step later."""

    u = Input()
    y = State(output=True)

    def update(u, next_y):
        next_y[0] = u + 1.0


# ---- FMUs ----


def handwritten(compiler: str, folder: Path, version: int) -> list[Path]:
    """relay.c as two FMUs; with functions that fail in the place of those that it lacks and FMPy looks for."""
    text = (build.headers() / f"fmi{version}Functions.h").read_text()
    names = re.findall(r"_Export\s+\w+TYPE\s+(\w+);", text)
    stubs = folder / "stubs.c"
    stubs.write_text("".join(f"__attribute__((weak)) int {name}(void) {{ return 3; }}\n" for name in names))
    library = folder / "relay.so"
    options = ["-O2", "-shared", "-fPIC", f"-DFMI={version}", f"-I{build.headers()}"]
    subprocess.run([compiler, *options, HERE / "relay.c", stubs, "-o", library], check=True)
    paths = [folder / "one.fmu", folder / "other.fmu"]
    host = build.host()
    for path in paths:
        with zipfile.ZipFile(path, "w") as archive:
            archive.write(library, f"binaries/{host.folder(versions.find(f'{version}.0'))}/relay{host.suffix}")
            archive.writestr("modelDescription.xml", DESCRIPTIONS[version])
    return paths


def exported(folder: Path, version: int) -> list[Path]:
    """Two blocks of a diagram, each exported as an FMU."""
    relay = f"python: {Path(__file__).resolve()}:Relay, period: {STEP}"
    network = run.load(diagram(folder, STEPS, relay, relay))
    return [export_fmu(network, [name], folder / f"{name}.fmu", f"{version}.0") for name in ("one", "other")]


def diagram(folder: Path, steps: int, one: str, other: str) -> Path:
    """Write a diagram of two blocks in a loop."""
    path = folder / "loop.yaml"
    path.write_text(DIAGRAM.format(stop=steps * STEP, step=STEP, one=one, other=other))
    return path


@dataclass(frozen=True)
class Pair:
    """Two FMUs, unpacked, and what all programs need to know of them."""

    fmus: list[Path]
    folders: list[Path]
    descriptions: list[Any]
    version: int
    events: bool  # whether each communication point is an event, as cosim does it where an FMU allows that
    u: int
    y: int

    @classmethod
    def of(cls, fmus: list[Path]) -> Pair:
        """Unpack and read two FMUs that have the same variables."""
        folders = [Path(fmpy.extract(path, path.with_suffix(""))) for path in fmus]
        descriptions = [fmpy.read_model_description(folder) for folder in folders]
        version = descriptions[0].fmiMajorVersion
        events = version == 3 and bool(descriptions[0].coSimulation.hasEventMode)
        references = {v.name: v.valueReference for v in descriptions[0].modelVariables}
        return cls(fmus, folders, descriptions, version, events, references["u"], references["y"])

    def libraries(self) -> list[str]:
        """Library and token of each, for the C program."""
        found = []
        for folder, read in zip(self.folders, self.descriptions, strict=True):
            (path,) = folder.glob(f"binaries/*/{read.coSimulation.modelIdentifier}.*")
            found += [str(path), read.guid or read.instantiationToken]
        return found


# ---- programs: each runs once, and gives microseconds a step ----


def compiled_host(compiler: str, folder: Path, version: int) -> Path:
    """Compile exchange.c for an FMI version."""
    path = folder / f"host{version}"
    options = ["-O2", f"-DFMI={version}", f"-I{build.headers()}"]
    subprocess.run([compiler, *options, HERE / "exchange.c", "-o", path, "-ldl"], check=True)
    return path


def output_of(*command: object) -> list[float]:
    """The numbers that a program prints."""
    done = subprocess.run([str(part) for part in command], stdout=subprocess.PIPE, check=True, text=True)
    return [float(word) for word in done.stdout.split()]


def called_from_c(host: Path, pair: Pair) -> float:
    """The functions of the FMUs, called from C."""
    seconds, *last = output_of(host, *pair.libraries(), pair.u, pair.y, int(pair.events), STEPS)
    return per_step(seconds, STEPS, last)


def cosim(pair: Pair, folder: Path, steps: int, isolate: bool) -> Callable[[], float]:
    """cosim's loop, from the first step to the last, with all that a run does between batches of steps."""
    one, other = (f"fmu: {path}, isolate: {str(isolate).lower()}" for path in pair.fmus)
    built = program.build(run.load(diagram(folder, steps, one, other)), "jacobi")
    kernels = compilation.compile_program(built)

    def once() -> float:
        simulated = Simulation(built, kernels)
        simulated.initialize()
        began = clock.perf_counter()
        for _ in simulated.batches():
            pass
        seconds = clock.perf_counter() - began
        simulated.close()
        return per_step(seconds, steps, [float(simulated.value(Signal(name, "y"))) for name in ("one", "other")])

    return once


def called_from_fmpy(pair: Pair) -> float:
    """FMPy's classes, called as `fmpy.simulation` does: prepared arrays for setters, lists from getters."""
    fmus = [opened(pair, k) for k in range(2)]
    began = clock.perf_counter()
    last = step2(fmus, pair) if pair.version == 2 else step3(fmus, pair)
    seconds = clock.perf_counter() - began
    for fmu in fmus:
        fmu.terminate()
        fmu.freeInstance()
    return per_step(seconds, FMPY_STEPS, last)


def opened(pair: Pair, k: int) -> Any:
    """One of the FMUs in FMPy, initialized."""
    read = pair.descriptions[k]
    fmu = (FMU2Slave if pair.version == 2 else FMU3Slave)(
        guid=read.guid or read.instantiationToken,
        unzipDirectory=str(pair.folders[k]),
        modelIdentifier=read.coSimulation.modelIdentifier,
        instanceName="relay",
    )
    if pair.version == 2:
        fmu.instantiate()
        fmu.setupExperiment(startTime=0.0)
    else:
        fmu.instantiate(eventModeUsed=pair.events)
    fmu.enterInitializationMode()
    fmu.exitInitializationMode()
    if pair.events:
        fmu.updateDiscreteStates()
        fmu.enterStepMode()
    return fmu


def step2(fmus: list[Any], pair: Pair) -> list[float]:
    """FMI 2: all steps of both FMUs. Returns their last outputs."""
    references, values, outputs = (fmi2ValueReference * 1)(pair.u), (fmi2Real * 1)(), [pair.y]
    for k in range(FMPY_STEPS):
        one, other = [fmu.getReal(vr=outputs)[0] for fmu in fmus]
        for fmu, value in zip(fmus, (other, one), strict=True):
            values[:] = (value,)
            fmu.fmi2SetReal(fmu.component, references, 1, values)
            fmu.doStep(currentCommunicationPoint=k * STEP, communicationStepSize=STEP)
    return [fmu.getReal(vr=outputs)[0] for fmu in fmus]


def step3(fmus: list[Any], pair: Pair) -> list[float]:
    """FMI 3: all steps of both FMUs. Returns their last outputs."""
    references, values, outputs = (fmi3ValueReference * 1)(pair.u), (fmi3Float64 * 1)(), [pair.y]
    events = pair.events
    for k in range(FMPY_STEPS):
        if events:
            for fmu in fmus:
                fmu.enterEventMode()
        one, other = [fmu.getFloat64(vr=outputs, nValues=1)[0] for fmu in fmus]
        for fmu, value in zip(fmus, (other, one), strict=True):
            values[:] = (value,)
            fmu.fmi3SetFloat64(fmu.component, references, 1, values, 1)
            if events:
                while fmu.updateDiscreteStates()[0]:
                    pass
                fmu.enterStepMode()
            fmu.doStep(currentCommunicationPoint=k * STEP, communicationStepSize=STEP)
    return [fmu.getFloat64(vr=outputs, nValues=1)[0] for fmu in fmus]


def per_step(seconds: float, steps: int, last: list[float]) -> float:
    """Microseconds a step, of FMUs that have handed on every one."""
    assert last == [steps, steps], last
    return 1e6 * seconds / steps


# ---- table ----

Times = dict[str, list[float]]


def median(values: list[float], digits: int) -> str:
    """Median and quartiles, as one text."""
    first, middle, third = np.percentile(values, [25, 50, 75])
    return f"{middle:.{digits}f} ({first:.{digits}f} … {third:.{digits}f})"


def print_rows(heads: Iterable[str], rows: dict[str, list[str]]) -> None:
    """A table with a name for each row."""
    print(" " * 24 + "".join(f"{head:>23}" for head in heads))
    for name, cells in rows.items():
        print(f"{name:<24}" + "".join(f"{cell:>23}" for cell in cells))


def ratios(t: Times, trips: list[float]) -> list[str]:
    """One row of the second table: what programs cost beside each other in the same round."""
    rounds = list(zip(t["C"], t["cosim"], t["FMPy"], t["isolated"], trips, strict=True))
    return [
        median([ours / theirs for _, ours, theirs, _, _ in rounds], 3),
        median([ours - c for c, ours, _, _, _ in rounds], 3),
        median([apart / ours for _, ours, _, apart, _ in rounds], 0),
        median([apart / CALLS / trip for _, _, _, apart, trip in rounds], 2),
    ]


def report(times: dict[str, Times], trips: list[float]) -> None:
    """Print what was measured, and what it means."""
    digits = {"C": 3, "cosim": 3, "FMPy": 1, "isolated": 1}
    print(f"Microseconds a step of both FMUs, median (quartiles) of {len(trips)} rounds:")
    print_rows(digits, {name: [median(t[p], d) for p, d in digits.items()] for name, t in times.items()})
    print("\nWithin a round:")
    heads = ["cosim / FMPy", "cosim - C", "isolated / cosim", "isolated call / pipe"]
    print_rows(heads, {name: ratios(t, trips) for name, t in times.items()})
    print(
        f"\nRound trip through two pipes, from C: {median(trips, 1)} microseconds; an isolated step is {CALLS} calls."
    )


def programs(pair: Pair, host: Path, folder: Path) -> dict[str, Callable[[], float]]:
    """What is timed of a pair, by name."""
    return {
        "C": lambda: called_from_c(host, pair),
        "cosim": cosim(pair, folder, STEPS, isolate=False),
        "FMPy": lambda: called_from_fmpy(pair),
        "isolated": cosim(pair, folder, ISOLATED_STEPS, isolate=True),
    }


def main() -> None:
    """Build, take turns, print."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--rounds", type=int, default=7)
    parser.add_argument("--cc", default="gcc")
    options = parser.parse_args()
    timed = {}
    with tempfile.TemporaryDirectory() as name:
        for version in (2, 3):
            host = compiled_host(options.cc, Path(name), version)
            for maker in ("from C", "exported"):
                folder = Path(name) / f"{maker}{version}"
                folder.mkdir()
                native = maker == "from C"
                pair = Pair.of(handwritten(options.cc, folder, version) if native else exported(folder, version))
                timed[f"FMI {version}, {maker}{', events' * pair.events}"] = programs(pair, host, folder)
        times: dict[str, Times] = {pair: {program: [] for program in made} for pair, made in timed.items()}
        trips = []
        for _ in range(options.rounds):
            trips.append(1e6 * output_of(host, TRIPS)[0] / TRIPS)
            for pair_name, made in timed.items():
                for program, once in made.items():
                    times[pair_name][program].append(once())
    report(times, trips)


if __name__ == "__main__":
    main()
