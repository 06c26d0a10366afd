"""Diagrams with every block of a file of the library: of scalars, of vectors, or of a fleet."""

from __future__ import annotations

from pathlib import Path
from types import ModuleType

from cosim.authoring.variables import OpenDimension, Variable
from cosim.wiring import library

#: The files of the library that are for everybody, as `cosim blocks` groups them.
FILES = (
    *("sources", "arithmetic", "vector_parts", "nonlinear", "tables", "continuous", "pid", "filters"),
    *("discrete", "logic", "sensors", "estimation_control", "predictive_control", "noise"),
)
VARIANTS = {"scalar": "", "vector": "", "fleet": ", per: robot"}

CHAIN = "A: [[0, 1, 0], [0, 0, 1], [0.1, 0.2, 0.3]], Q: [[1, 0, 0], [0, 1, 0], [0, 0, 1]]"
#: What a block cannot do without, by variant where it differs.
PARAMETERS = {
    "TableSource": {
        "": "times: [0, 0.1, 0.25], values: [1, 3, -1]",
        "vector": "times: [0, 0.1], values: [[1, 2], [3, 4]]",
    },
    "MatrixGain": {"": "K: [[1], [2]]", "vector": "K: [[1, 2, 3], [4, 5, 6]]"},
    "LookUp2D": {"": "points_1: [-1, 0, 2], points_2: [-1, 1], values: [[0, 1], [2, 3], [5, 4]]"},
    "StateSpace": {
        "": "A: [[0, 1], [-4, -1]], B: [[0], [1]], C: [[1, 0]]",
        "vector": "A: [[0, 1], [-4, -1]], B: [[0, 1, 1], [1, 0, 2]], C: [[1, 0], [0, 1]]",
    },
    "Select": {"": "elements: [3, 1]"},
    "StateMachine": {
        "": "table: [[1, 2], [2, 1]], values: [5, 7]",
        "vector": "table: [[1, 2, 1, 2, 1, 2, 1, 2], [2, 1, 1, 1, 1, 1, 1, 2]], values: [5, 7]",
    },
    "FirstOrderHold": {"": "T: 0.07"},  # never at the time of another's sample, where an FMU has one event for both
    "Square": {"": "frequency: 7"},
    "Step": {"": "at: 0.1234"},
    "Pulse": {"": "at: 0.05, width: 0.0333"},
    "Luenberger": {
        "": "A: [[0, 1], [-4, -1]], B: [[0], [1]], C: [[1, 0]], L: [[1], [2]]",
        "vector": (
            "A: [[0, 1], [-4, -1]], B: [[0, 1, 1], [1, 0, 2]], C: [[1, 0], [0, 1], [1, 1]], L: [[1, 0, 1], [2, 1, 0]]"
        ),
    },
    "KalmanFilter": {
        "": "A: [[1, 0.1], [0, 1]], B: [[0], [1]], C: [[1, 0]], Q: [[0.1, 0], [0, 0.2]], R: [0.3]",
        "vector": (
            "A: [[1, 0.1], [0, 1]], B: [[0, 1, 1], [1, 0, 2]], C: [[1, 0], [0, 1], [1, 1]], Q: [[0.1, 0], [0, 0.2]],"
            " R: [0.3, 0.1, 1]"
        ),
    },
    "LQR": {"": f"{CHAIN}, B: [[0], [0], [1]]", "vector": f"{CHAIN}, B: [[0, 1], [0, 0], [1, 0]], R: [[1, 0], [0, 2]]"},
}
PARAMETERS["DiscreteLQR"] = PARAMETERS["LQR"]
PARAMETERS["LinearMPC"] = {key: text + ", lower: -0.5, upper: 0.7" for key, text in PARAMETERS["LQR"].items()}
PARAMETERS["StateSpaceFeedthrough"] = {key: text + ", D: 0.5" for key, text in PARAMETERS["StateSpace"].items()}
PARAMETERS["DiscreteStateSpaceFeedthrough"] = {
    key: text.replace("-4, -1", "-0.4, -0.1") for key, text in PARAMETERS["StateSpaceFeedthrough"].items()
}
PARAMETERS["DiscreteStateSpace"] = {
    key: text.replace("-4, -1", "-0.4, -0.1") for key, text in PARAMETERS["StateSpace"].items()
}
NOISES = {"BandLimitedNoise": "bandwidth", "RandomWalk": "intensity", "UniformNoise": "high", "WhiteNoise": "mean"}
PARAMETERS |= {
    name: {"": f"seed: {k}", "vector": f"seed: {k}, {own}: [1, 2, 3]", "fleet": f'seed: "{k} + 10*i"'}
    for k, (name, own) in enumerate(NOISES.items())
}
POSITIVE = {"Log", "Sqrt", "Division"}


def blocks_of(module: ModuleType | str) -> list[str]:
    """The blocks of one file, by name."""
    return [name for name, block in library.all_blocks().items() if block.__module__.endswith(f".blocks.{module}")]


def _source(block: str, variable: Variable, variant: str) -> str:
    """What an input is wired to."""
    kind = "truth" if variable.dtype == bool else "above_zero" if block in POSITIVE else "wave"
    if any(isinstance(d, OpenDimension) for d in variable.shape):
        return f"{kind}.{'above' if kind == 'truth' else 'y'}"
    if variable.shape == () and variant == "vector":
        return {"truth": '"truth.above[1]"', "wave": '"wave.y[1]"'}[kind]
    if variable.shape == ():
        return f"{kind}.{'above' if kind == 'truth' else 'y'}"
    return f"vector_{variable.shape[0]}.y" if isinstance(variable.shape[0], int) else "vector_3.y"


def _entry(name: str, variant: str, parameters: str) -> str:
    declaration = library.all_blocks()[name].declaration
    inputs = [v for v in declaration.variables.values() if v.causality == "input"]
    wires = ", ".join(f"{v.name}: {_source(name, v, variant)}" for v in inputs)
    sampled = bool(declaration.kind("update")) or "period" in declaration.variables
    period = ", period: 0.015625" if sampled or name == "ZeroOrderHold" else ""
    return f"  {name}: {{block: {name}{VARIANTS[variant]}{period}, parameters: {{{parameters}}}, inputs: {{{wires}}}}}"


def write(folder: Path, file: str, variant: str) -> tuple[Path, list[str]]:
    """A diagram with each block of a file, and the signals that they give."""
    amplitude = "[1, 2, 3]" if variant == "vector" else '"i"' if variant == "fleet" else "1"
    per = VARIANTS[variant]
    lines = [
        "title: Every block of a file",
        "run: {stop: 0.5, step: 0.0078125, integrator: rk4}",
        "fleets: {robot: 2}",
        "blocks:",
        f"  wave: {{block: Sine, parameters: {{amplitude: {amplitude}, frequency: 3, phase: 0.3}}{per}}}",
        f"  above_zero: {{block: Sine, parameters: {{amplitude: {amplitude}, bias: 4}}{per}}}",
        f"  truth: {{block: Compare, parameters: {{threshold: 0.4}}, inputs: {{u: wave.y}}{per}}}",
        "  vector_2: {block: Sine, parameters: {amplitude: [1, 2]}}",
        "  vector_3: {block: Sine, parameters: {amplitude: [1, 2, 3]}}",
    ]
    signals = []
    for name in blocks_of(file):
        known = PARAMETERS.get(name, {"": ""})
        lines.append(_entry(name, variant, known.get(variant, known[""])))
        variables = library.all_blocks()[name].declaration.variables.values()
        signals += [f"{name}.{v.name}" for v in variables if v.causality in ("output", "local") and v.dtype != object]
    path = folder / f"{file}_{variant}.yaml"
    path.write_text("\n".join(lines) + "\n")
    return path, signals
