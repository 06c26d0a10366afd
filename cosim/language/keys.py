"""Every key of a diagram, declared once: its type and range, the blocks it goes with, its default, a line of help.

The grammar, the reading of values, the words of mistakes and `cosim keys` come from here.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

from cosim.errors import WrongType, WrongValue
from cosim.integrators import KNOWN
from cosim.language import data_files
from cosim.language.reader import MOST, Reader, is_constant
from cosim.language.source import Node, describe

ANY = "*"
ADDS = "+"
"""How a key of an overlay ends that adds to the list of that name."""
TYPES = ("block", "python", "fmu", "diagram", "expression")
SAMPLED = ("block", "python", "fmu", "expression")
INTEGRATED = ("block", "python", "fmu")
METHODS = ("jacobi", "gauss-seidel", "iterated", "joint")
MODES = ("co-simulation", "model-exchange")
LOGS = ("errors", "all", "none")
REDUCTIONS = (
    *("max", "min", "mean", "rms", "final", "events"),
    *("settling_time", "rise_time", "overshoot", "iae", "ise", "itae"),
    *("time_of_max", "time_of_min", "percentile"),
)
MOST_EXTRAPOLATION = 2
MOST_INNER_STEPS = 1_000_000  # between two points at which a run is seen or interrupted


@dataclass(frozen=True)
class Type:
    """What a value may be: how it is read (of what is none, the default or None is left), and in words.

    known: the words of which it is one, also those that are added later. form: the same as a JSON Schema says it, as
    far as one can.
    """

    read: Callable[[Reader, Node, str, Any], Any]
    meaning: str = ""
    known: Iterable[str] = ()
    form: Mapping[str, Any] = field(default_factory=dict)

    @property
    def words(self) -> str:
        """What may be written."""
        return self.meaning or " | ".join(self.known)


@dataclass(frozen=True)
class Key:
    """A key of the YAML. below: the keys of a section, ANY for names that the user gives; none for a value.

    With both a type and something below it, it is either.

    kinds: of block that it goes with. example: of what to write where it is missing. layer: what stands below lies over
    another tree, where `~` takes away what that says.
    """

    help: str
    type: Type | None = None
    default: Any = None
    unit: str = ""
    kinds: tuple[str, ...] = TYPES
    example: str = ""
    below: Mapping[str, Key] = field(default_factory=dict)
    layer: bool = False


# ---- types ----

NUMERIC = {"type": ["number", "string"]}
"""The form of a number, which may be arithmetic, such as "2*pi"."""
WHOLE = {"type": ["integer", "string"]}


def choice(known: Iterable[str]) -> Type:
    """One of some words; what is added to them later counts."""
    return Type(lambda reader, node, where, _: reader.choice(node, where, known), known=known)


def count(most: int = MOST) -> Type:
    """A whole number from 1."""
    words = "whole number from 1" + (f" to {most}" if most < MOST else "")
    form = {**WHOLE, "minimum": 1, "maximum": most}
    return Type(lambda reader, node, where, _: reader.count(node, where, most), words, form=form)


EXTRAPOLATION = Type(
    lambda reader, node, where, _: reader.order(node, where, MOST_EXTRAPOLATION),
    "0 | 1 | 2",
    form={**WHOLE, "minimum": 0, "maximum": MOST_EXTRAPOLATION},
)


def between(least: float, most: float) -> Type:
    """A number within bounds; None for anything else."""
    words = f"number from {least:g} to {most:g}"

    def read(reader: Reader, node: Node, where: str, _: Any) -> float | None:
        before = len(reader.problems.errors)
        value = reader.number(node, where, least)
        if len(reader.problems.errors) > before:
            return None
        if least <= value <= most:
            return value
        reader.wrong(node, f"`{where}` must be a {words}, not {describe(node)}", "such as 1e-6", WrongValue)
        return None

    return Type(read, words, form={**NUMERIC, "minimum": least, "maximum": most})


TEXT = Type(lambda reader, node, where, _: reader.text(node, where) or None, "text", form={"type": "string"})
TRUTH = Type(lambda reader, node, where, _: reader.truth(node, where), "true or false", form={"type": "boolean"})
NUMBER = Type(lambda reader, node, where, default: reader.number(node, where, default), "number", form=NUMERIC)
POSITIVE = Type(
    lambda reader, node, where, default: reader.positive(node, where, math.nan if default is None else default),
    "number above zero",
    form={**NUMERIC, "exclusiveMinimum": 0},
)
NOT_NEGATIVE = Type(
    lambda reader, node, where, default: reader.not_negative(node, where, default),
    "number from zero",
    form={**NUMERIC, "minimum": 0},
)
TOLERANCE = between(1e-13, 0.1)
SIGNAL = Type(
    lambda reader, node, where, _: node if reader.endpoint(node, where) else None,
    "block.port",
    form={"type": "string", "pattern": r"\."},
)
NAMES = Type(lambda reader, node, where, _: node, "text, or a list of such")
ANYTHING = Type(lambda reader, node, where, _: node)


def _size(reader: Reader, node: Node, where: str, _: Any) -> int | None:
    """A whole number from 1; None where a mistake keeps it from being known."""
    before = len(reader.problems.errors)
    size = reader.count(node, where)
    return size if len(reader.problems.errors) == before else None


def _sources(reader: Reader, node: Node, where: str, _: Any) -> Any:
    """What an input reads, or its constant; an empty list where a mistake keeps that from being known."""
    if node.value == []:
        reader.wrong(node, f"`{where}` is an empty list", "name what it reads, such as plant.x", WrongValue)
    if is_constant(node):
        return node.value
    if isinstance(node.value, list) and (constant := next(filter(is_constant, node.value), None)):
        message = f"`{where}` lists {describe(constant)} beside what it reads"
        fix = "write block.port here too, or numbers only, for a constant"
        reader.wrong(constant, message, fix, WrongValue)
        return []
    return node.value if reader.endpoints(node, where) else []


def _log(reader: Reader, node: Node, where: str, _: Any) -> Any:
    """One of LOGS as it is, else a list of categories; None where it is neither."""
    if node.value in LOGS:
        return node.value
    if node.value == []:
        reader.wrong(node, f"`{where}` is an empty list", "write none, or name categories of the FMU", WrongValue)
    nodes = node.value if isinstance(node.value, list) else [node]
    known = [reader.text(child, where) for child in nodes]  # all of them: each has its report
    return nodes if known and all(known) else None


def _variables(reader: Reader, node: Node, where: str, _: Any) -> Any:
    """A name, or nested lists of names; None where it is neither."""
    if not isinstance(node.value, list):
        return reader.text(node, where) or None
    if not node.value:
        reader.wrong(node, f"`{where}` is an empty list", "name variables of the FMU, such as [px, py]", WrongValue)
    known = [_variables(reader, child, where, None) for child in node.value]  # all of them: each has its report
    return node.value if known and None not in known else None


def _data(reader: Reader, node: Node, where: str, _: Any) -> Any:
    if isinstance(node.value, dict) and "file" in node.value:
        return reader.problems.attempt(data_files.read, node)
    return node.value if _is_data(reader, node, where) else None


def _is_data(reader: Reader, node: Node, where: str) -> bool:
    """Whether a value is a scalar or nested lists of such, else a report."""
    if isinstance(node.value, list):
        children = [_is_data(reader, child, where) for child in node.value]  # all of them: each has its report
        return all(children)
    if isinstance(node.value, dict) or node.value is None:
        fix = "write a number, or a list such as [1, 2], or {file: table.csv, column: torque}"
        message = f"`{where}` must be a number, a text or a list, not {describe(node)}"
        reader.wrong(node, message, fix, WrongType)
        return False
    return True


def _order(reader: Reader, node: Node, where: str, _: Any) -> tuple[str, ...]:
    """A list of names, each once."""
    if not isinstance(node.value, list):
        reader.wrong(node, f"`{where}` must be a list of blocks, not {describe(node)}", "such as [plant, observer]")
        return ()
    names: dict[str, None] = {}
    for child in node.value:
        name = reader.text(child, where)
        if name in names:
            reader.wrong(child, f"`{where}` names `{name}` twice", "write it once", WrongValue)
        names[name] = None
    return tuple(filter(None, names))


SIZE = Type(_size, "whole number from 1", form={**WHOLE, "minimum": 1})
SOURCES = Type(_sources, "block.port, or a list of such; or a constant")
LOG = Type(_log, f"{' | '.join(LOGS)}, or a list of its categories")
VARIABLES = Type(_variables, "variable, or a list of such; x_{1..3} is short for x_1, x_2, x_3")
ORDER = Type(_order, "list of blocks", form={"type": "array", "items": {"type": "string"}})
DATA = Type(_data, "number, text, or lists of them; or {file: …}")
FORMULA = Type(
    lambda reader, node, where, _: reader.text(node, where) or None,
    "formula, such as always(plant.x < 1)",
    form={"type": "string"},
)
ARITHMETIC = Type(lambda reader, node, where, _: node, "text, or one for each output")
NAMED = {ANY: Key("", ANYTHING)}

# ---- the keys ----

WIRE: dict[str, Key] = {
    "from": Key("what is read, where more is said of the wire than that", SOURCES, example="block.port"),
    "delay": Key("how long ago; from the step on", POSITIVE, unit="s"),
    "extrapolation": Key("order of what is read between two communication points", EXTRAPOLATION),
}

DATA_FILE: dict[str, Key] = {
    "file": Key("a CSV table, or an NPZ or NPY file of arrays, from the folder of this diagram", TEXT),
    "column": Key("which column of a table; none: all", TEXT),
    "array": Key("which array of an NPZ file; none: the only one", TEXT),
    "sha256": Key("digest that the file's content must have; none: any content", TEXT),
}

BLOCK: dict[str, Key] = {
    "block": Key("a block type of the library, see `cosim blocks`", TEXT),
    "python": Key("a block type of your own, file.py:Class", TEXT),
    "fmu": Key("an FMU", TEXT),
    "diagram": Key("a diagram as a block", TEXT),
    "expression": Key(
        "arithmetic of its inputs and parameters, such as k*(r - x); its output is y, or those that are named",
        ARITHMETIC,
        below={ANY: Key("", TEXT)},
    ),
    "per": Key("the fleet for each of whose members there is one", TEXT),
    "parameters": Key("values, by parameter", below={ANY: Key("", DATA, below=DATA_FILE)}),
    "start": Key("start values, by state or input", below={ANY: Key("", DATA, below=DATA_FILE)}),
    "inputs": Key("what each input reads", below={ANY: Key("", SOURCES, below=WIRE)}),
    "dimensions": Key("sizes, by dimension", below={ANY: Key("", SIZE)}),
    "period": Key("how often it is due; between, its outputs are held", POSITIVE, unit="s", kinds=SAMPLED),
    "offset": Key("when it is due first", NOT_NEGATIVE, 0.0, unit="s", kinds=SAMPLED),
    "integrator": Key("its own integrator; none: that of the run", choice(KNOWN), kinds=INTEGRATED),
    "inner_steps": Key("in how many steps it integrates one of the run's", count(MOST_INNER_STEPS), kinds=INTEGRATED),
    "tolerance": Key("of inner steps, and inside an FMU; none: that of the run", TOLERANCE, kinds=INTEGRATED),
    "absolute_tolerance": Key("as that of the run", POSITIVE, kinds=INTEGRATED),
    "ports": Key("the FMU's variables behind each name of ours", below={ANY: Key("", VARIABLES)}, kinds=("fmu",)),
    "mode": Key("which interface of an FMU", choice(MODES), kinds=("fmu",)),
    "event_mode": Key(
        "whether FMI 3's Co-Simulation has one; auto: if the FMU can", choice(("auto", "on", "off")), kinds=("fmu",)
    ),
    "start_time": Key("what an FMU's clock shows as the run begins", NUMBER, 0.0, unit="s", kinds=("fmu",)),
    "log": Key("which of its messages an FMU is to log", LOG, "errors", kinds=("fmu",)),
    "log_file": Key("where they are written as they come; none: the last ones are kept", TEXT, kinds=("fmu",)),
    "isolate": Key("whether an FMU gets a process of its own", TRUTH, False, kinds=("fmu",)),
    "drop": Key("what was written for the type that this one replaces, and goes with it", NAMES),
}
RUN: dict[str, Key] = {
    "stop": Key("when it ends", POSITIVE, unit="s", example="30"),
    "step": Key("the communication step", POSITIVE, unit="s", example="1.0e-3"),
    "method": Key("how blocks are coupled", choice(METHODS), "jacobi"),
    "coupling_tolerance": Key("relative error of what is exchanged; none: all steps are of one size", POSITIVE),
    "smallest_step": Key("the smallest communication step; none: step / 1024", POSITIVE, unit="s"),
    "rollback": Key("whether a step that a tolerance finds too long is done anew", TRUTH, True),
    "extrapolation": Key("order of what blocks read between two communication points", EXTRAPOLATION, 0),
    "integrator": Key("of continuous states; lsoda to dop853: scipy's", choice(KNOWN), "euler"),
    "inner_steps": Key("in how many steps of theirs a step is integrated", count(MOST_INNER_STEPS), 1),
    "tolerance": Key(
        "of the error of an inner step over a state's size, which sets that step; none: equal ones", TOLERANCE
    ),
    "absolute_tolerance": Key("added to it, in the state's unit; none: a thousandth of it", POSITIVE),
    "order": Key("under gauss-seidel, the blocks whose turns come first, in this order", ORDER, ()),
    "patience": Key("how long a call of an FMU may give no sign of life", POSITIVE, 10.0, unit="s"),
}
INTEGRATION = ("integrator", "inner_steps", "tolerance", "absolute_tolerance")
"""What a block may say otherwise than the run of how its states are integrated."""
RECORD: dict[str, Key] = {
    "period": Key("how often; none: at every step", POSITIVE, unit="s"),
    "signals": Key("what is recorded, block.port each", ANYTHING),
}
METRIC: dict[str, Key] = {
    "signal": Key("what is reduced", SIGNAL, example="block.port"),
    "reduce": Key("how", choice(REDUCTIONS)),
    "from": Key("where its window begins", NUMBER, 0.0, unit="s"),
    "to": Key("where it ends; none: at the end", NUMBER, math.inf, unit="s"),
    "reference": Key("of an error, none: 0; where a response is to end, none: its last sample", NUMBER),
    "band": Key("of a settling time: how near to the end, in parts of the way; none: 0.02", POSITIVE),
    "within": Key("in the place of a band: how near to the end, in the signal's unit", POSITIVE),
    "percent": Key("of a percentile; none: 95", between(0.0, 100.0)),
}
METRIC_OPTIONS = ("reference", "band", "within", "percent")
REQUIREMENT: dict[str, Key] = {
    "formula": Key("in signal temporal logic", TEXT, example="always(plant.x < 1)"),
    "stop": Key("violated: the run ends soon after it is violated", choice(("violated",))),
}
ANIMATION: dict[str, Key] = {
    "positions": Key("where bodies are: (bodies, at least 2)", SIGNAL, example="plant.x"),
    "references": Key("where they should be", SIGNAL),
    "radii": Key("of the bodies, in the unit of positions", SIGNAL),
    "neighbours": Key("whom each hears: numbers from 0, -1 for nobody", SIGNAL),
    "weights": Key("of what is heard, beside neighbours", SIGNAL),
}
"""The parts that signals play where bodies are shown moving."""
DIAGRAM: dict[str, Key] = {
    "title": Key("what it is called; none: as its file", TEXT),
    "extends": Key("the diagram that this one lies over", TEXT),
    "run": Key("how long, in what steps, how", below=RUN),
    "fleets": Key("how many members each fleet has", below={ANY: Key("", SIZE)}),
    "blocks": Key("the blocks, by name", below={ANY: Key("", below=BLOCK)}),
    "record": Key("what is written to the result file", below=RECORD),
    "metrics": Key("figures of the run, by name", below={ANY: Key("", below=METRIC)}),
    "requirements": Key("what the run has to keep, by name", below={ANY: Key("", FORMULA, below=REQUIREMENT)}),
    "animation": Key("the signals that `cosim plot --animate` shows, by the part they play", below=ANIMATION),
    "inputs": Key("as a block of another diagram: the ports that each input drives", below=NAMED),
    "outputs": Key("as a block of another diagram: the port that each output shows", below=NAMED),
}


def read_value(key: Key, node: Node, where: str, reader: Reader) -> Any:
    """The value that a node gives a key; the default where it is a mistake."""
    assert key.type, where
    return key.type.read(reader, node, where, key.default)


def read_section(keys: Mapping[str, Key], entries: Mapping[str, Node], where: str, reader: Reader) -> dict[str, Any]:
    """The values of all keys of a section, the defaults of those that it leaves out."""
    return {
        name: read_value(key, entries[name], f"{where}.{name}", reader) if name in entries else key.default
        for name, key in keys.items()
    }


def read_named(key: Key, entries: Mapping[str, Node], where: str, reader: Reader) -> dict[str, Node]:
    """The values below a section of names that the user gives, each in its node; those left out that are mistakes."""
    read = {name: read_value(key.below[ANY], node, f"{where}.{name}", reader) for name, node in entries.items()}
    return {name: replace(entries[name], value=value) for name, value in read.items() if value is not None}
