"""`cosim debug`: go to a moment of a run at full speed, and on from there in Python's debugger."""

from __future__ import annotations

import argparse
import sys

from cosim.authoring.lowering.block_functions import lowered
from cosim.compiling.kernels import Kernels
from cosim.engine import compilation, program
from cosim.engine.hand_run import HandRun
from cosim.engine.program import Program
from cosim.errors import CosimError, UnknownBlock, UsageError, nearest
from cosim.terminal import screen
from cosim.terminal.commands.options import diagram_arguments, load_network
from cosim.terminal.debugger import Debugger, Place
from cosim.terminal.exits import DONE, STOPPED
from cosim.tracing import halts, hand_over
from cosim.tracing.halts import Halt
from cosim.wiring.network import Network


def arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    diagram_arguments(parser)
    parser.add_argument("--at", type=float, metavar="TIME", help="stop there (s)")
    help_ = 'stop where this holds first, of any member, such as "separation.min_gap < 0.02"'
    parser.add_argument("--when", metavar="CONDITION", help=help_)
    parser.add_argument(
        "--block", metavar="NAME", help="stop in this block's functions (default: in the first there is)"
    )
    parser.add_argument("--member", type=int, default=1, metavar="I", help="of a fleet, from 1 (default: 1)")
    parser.description = (
        "Go to a moment of a run at full speed, and on from there as plain Python in Python's debugger, which stops in"
        " the author's function. Without --at and --when, that moment is the one before the run fails."
    )
    parser.epilog = (
        "`p x` prints, `n` goes to the next line, `b 41` stops at line 41 too, `c` goes on: with the next breakpoint as"
        " Python, with none left at full speed to the end; `q` quits. All figures are those of `cosim run`, to the bit."
    )


def run(options: argparse.Namespace) -> int:
    """Go there, and hand over to the debugger; 1 if the run fails afterwards."""
    if options.at is not None and options.when is not None:
        raise UsageError("--at and --when exclude each other", fix="leave one of them out")
    network = load_network(options)
    _refuse(network, options)
    made = program.build(network, network.diagram.run.method)
    kernels = compilation.compile_program(made)
    kernels.load()
    moment = _moment(made, kernels, options)
    if moment is None:
        return DONE
    return _debug(made, kernels, moment, options.block or moment.component, options.member)


def _refuse(network: Network, options: argparse.Namespace) -> None:
    """Raises: UsageError for what cannot be debugged so, UnknownBlock."""
    foreign = [c.name for c in network.components.values() if c.declaration.foreign]
    if foreign:
        message = f"{foreign[0]} is an FMU, which has no Python functions, and cannot change the engine on the way"
        raise UsageError(message, fix=f"--swap {foreign[0]}=TYPE, a block in its place")
    if options.block is not None and options.block not in network.components:
        fix = nearest(options.block, network.components)
        raise UnknownBlock(f"there is no block `{options.block}`", fix=fix)
    if options.member < 1:
        raise UsageError(f"there is no member {options.member}", fix="count from 1")


def _moment(made: Program, kernels: Kernels, options: argparse.Namespace) -> Halt | None:
    """Where to stop; None, which is said, where the run has no such moment."""
    if options.at is not None:
        return halts.at(made, options.at)
    if options.when is not None:
        found = halts.first(made, kernels, options.when)
        missing = f"{options.when} does not hold at any communication point of the run"
    else:
        found = halts.failure(made, kernels)
        missing = "the run comes to its end without a failure: --at TIME or --when CONDITION says where to stop"
    if found is None:
        screen.say(missing)
    return found


def _debug(made: Program, kernels: Kernels, moment: Halt, block: str, member: int) -> int:
    """Go on from a moment under a debugger: an editor's where there is one, which has its own breakpoints."""
    editor = sys.gettrace() is not None or "pydevd" in sys.modules  # which needs no trace function from 3.12 on
    debugger = Debugger(_functions(made, block), member - 1)
    try:
        simulation = hand_over.interpreted_at(made, kernels, moment.tick)
        until = "" if moment.tick is None else f"t = {simulation.time:g} s: compiled up to here, "
        screen.say(f"{moment.why}\n{until}Python from here on")
        for do in hand_over.ahead(simulation):
            if editor:
                do()
            elif debugger.has_reason or (moment.fails and not debugger.quitting):
                debugger.watch(do)
            else:
                break
        if not debugger.quitting:
            _finish(simulation, kernels)
    except CosimError as error:
        if debugger.quitting:  # which an author's function raises
            return DONE
        screen.print_errors(error)
        if error.__cause__ and not editor:
            debugger.look_at(error.__cause__)
        return STOPPED
    return DONE


def _functions(made: Program, block: str) -> list[Place]:
    """Where the functions of a block begin, or of all blocks."""
    found = []
    for call in made.calls:
        declaration = made.network.components[call.component].declaration
        if block in ("", call.component):
            code = lowered(declaration, call.function).python.__code__
            found.append((code.co_filename, code.co_firstlineno))
    return found


def _finish(simulation: HandRun, kernels: Kernels) -> None:
    """Go on at full speed to the end. Raises: CosimError of what fails on the way."""
    began = simulation.time
    rest = hand_over.handed_over(simulation, kernels)
    rest.go_to(rest.ticks)
    ended = f": {rest.termination.message}" if rest.termination else ""
    screen.say(f"compiled from t = {began:g} s to the end at t = {rest.time:g} s{ended}")
