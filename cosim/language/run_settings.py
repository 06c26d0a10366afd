"""How a diagram runs, as its section `run` says: how long, in what steps, by what method; what contradicts itself."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

from cosim.errors import WrongValue
from cosim.integrators import REFERENCES, Integration
from cosim.language.entry import BlockEntry
from cosim.language.keys import RUN, read_section
from cosim.language.reader import Reader, multiple
from cosim.language.source import Node


@dataclass
class RunSettings:
    """How long (s), in what steps (s) and by what method a diagram runs; `nodes` has what YAML says of each.

    order: the blocks whose turns come first. patience: for how long (s of wall-clock time) a call of an FMU may give no
    sign of life.
    """

    stop: float
    step: float
    method: str
    coupling_tolerance: float | None
    smallest_step: float | None
    rollback: bool
    extrapolation: int
    integrator: str
    inner_steps: int
    tolerance: float | None
    absolute_tolerance: float | None
    order: tuple[str, ...]
    patience: float
    nodes: dict[str, Node]

    @property
    def steps(self) -> int:
        """The number of communication steps up to `stop`."""
        return multiple(self.stop, self.step) or 0

    @property
    def integration(self) -> Integration:
        """How blocks are integrated that do not say so themselves, and all under `joint`."""
        return Integration(self.integrator, self.inner_steps, self.tolerance, self.absolute_tolerance)


def read_run(tree: Node, reader: Reader) -> RunSettings:
    """The run's settings; `stop` is a whole number of steps."""
    section = tree.value.get("run", tree)
    nodes = section.value if "run" in tree.value else {}
    values = read_section(RUN, nodes, "run", reader)
    for key in ("stop", "step"):
        if values[key] is None:
            values[key] = math.nan
            reader.missing(section, f"the diagram has no `run.{key}`", f"write run: {{{key}: {RUN[key].example}}}")
    run = RunSettings(**values, nodes=nodes)
    if run.smallest_step is not None and not run.coupling_tolerance:
        message = "`run.smallest_step` goes with `run.coupling_tolerance`, and there is none"
        reader.wrong(nodes["smallest_step"], message, "write run.coupling_tolerance too, such as 1.0e-4", WrongValue)
    if run.smallest_step is not None and run.stop > 2.0**52 * run.smallest_step:
        message = f"`run.smallest_step` of {run.smallest_step:g} s is too small to be counted up to {run.stop:g} s"
        reader.wrong(nodes["smallest_step"], message, f"such as {run.step / 1024:g}", WrongValue)
    if run.smallest_step is not None and run.smallest_step > run.step:
        message = f"`run.smallest_step` of {run.smallest_step:g} s is more than run.step of {run.step:g} s"
        reader.wrong(nodes["smallest_step"], message, "a smaller one; run.step is the largest", WrongValue)
    if "stop" in nodes:
        is_multiple(nodes["stop"], "run.stop", run.stop, run.step, reader)
    return run


def check_integration(run: RunSettings, blocks: Iterable[BlockEntry], reader: Reader) -> None:
    """Report settings of the integration that contradict each other."""
    if run.integrator in REFERENCES:
        _check_reference(run, reader)
    if run.tolerance is not None and run.inner_steps > 1:
        said = "`run.inner_steps` is how many equal steps there are, `run.tolerance` makes them as long as it allows"
        reader.wrong(run.nodes["inner_steps"], said, "remove one of them", WrongValue)
    tolerant = "tolerance" in run.nodes or any("tolerance" in entry.settings for entry in blocks)
    if run.absolute_tolerance is not None and not tolerant:
        said = "`run.absolute_tolerance` does nothing without a tolerance"
        reader.wrong(run.nodes["absolute_tolerance"], said, "add `tolerance`, such as 1e-6", WrongValue)


def check_clocks(run: RunSettings, blocks: Iterable[BlockEntry], reader: Reader) -> None:
    """Report an FMU's clock that begins so late that its steps are lost in rounding."""
    for entry in blocks:
        start = entry.settings.get("start_time")
        if start and (least := math.ulp(start.value)) > run.step / 1000:
            clock = f"a clock that begins at {start.value:g} s goes in steps of {least:.2g} s"
            message = f"block `{entry.name}`: {clock}, and `run.step` is {run.step:g} s"
            reader.wrong(start, message, "an earlier `start_time`, or a larger `run.step`", WrongValue)


def _check_reference(run: RunSettings, reader: Reader) -> None:
    """Report a run in which a method of scipy's has no place."""
    node, name = run.nodes["integrator"], run.integrator
    if run.method != "joint":
        said = f"`{name}` is scipy's, which integrates all blocks as one system; under `{run.method}` each steps alone"
        reader.wrong(node, said, "choose run.method: joint, or an integrator of ours such as rodas5p", WrongValue)
    elif run.tolerance is None and run.inner_steps == 1:
        said = f"`{name}` is scipy's, which chooses its steps by a tolerance, and there is none"
        reader.wrong(node, said, "write run.tolerance too, such as 1.0e-8", WrongValue)
    elif run.tolerance is None:
        said = f"`{name}` is scipy's, which chooses its steps by a tolerance, so it takes no `run.inner_steps`"
        reader.wrong(run.nodes["inner_steps"], said, "write run.tolerance instead, such as 1.0e-8", WrongValue)


def is_multiple(node: Node, name: str, value: float, step: float, reader: Reader) -> bool:
    """Whether a time is a whole number of steps; if not, a report whose fix is the nearest one that is."""
    if math.isnan(value) or math.isnan(step):
        return False
    if multiple(value, step):
        return True
    ratio = value / step
    fix = "choose a larger `run.step`" if ratio >= 2**53 else f"such as {max(round(ratio), 1) * step:.12g}"
    message = f"`{name}` of {value:g} s is not a whole number of steps of {step:g} s"
    reader.wrong(node, message, fix, WrongValue)
    return False
