"""The command line: `cosim run`, `cosim check`, `cosim blocks`."""

from __future__ import annotations

import argparse
import json
import sys
import time
from pathlib import Path
from typing import Any

from cosim.errors import CosimError

BAD_INPUT, STOPPED, INTERRUPTED = 2, 1, 130
EXIT_CODES = {"completed": 0, "diverged": STOPPED, "failed": STOPPED, "interrupted": INTERRUPTED}


def main(arguments: list[str] | None = None) -> int:
    """Entry point. Returns the exit code: 0 completed, 1 stopped, 2 bad input, 130 interrupted."""
    began = time.perf_counter()
    options = _parser().parse_args(arguments)
    options.began = began
    try:
        return options.command(options)
    except CosimError as error:
        from cosim import terminal

        if getattr(options, "json", False):
            print(json.dumps({"diagram": str(options.diagram), "status": "failed", "error": str(error)}))
        terminal.print_errors(error)
        return BAD_INPUT
    except KeyboardInterrupt:
        print("interrupted", file=sys.stderr)
        return INTERRUPTED
    except BrokenPipeError:
        # The reader of standard output has gone; what it read was all it wanted.
        sys.stderr.close()
        return 0


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="cosim", description="Co-simulation of block diagrams written in YAML.")
    commands = parser.add_subparsers(title="commands", required=True, metavar="COMMAND")
    run = commands.add_parser("run", help="run a diagram and print its metrics")
    _diagram_options(run)
    run.add_argument("--engine", choices=("native", "python"), default="native", help="python: for breakpoints")
    run.add_argument("-o", "--output", type=Path, metavar="FILE.nc", help="result file (default: results/<diagram>.nc)")
    run.add_argument("--csv", type=Path, metavar="FILE.csv", help="write the recorded signals as CSV too")
    run.add_argument("--json", action="store_true", help="print one JSON object and nothing else")
    run.set_defaults(command=_run)
    check = commands.add_parser("check", help="validate a diagram without running it")
    _diagram_options(check)
    check.set_defaults(command=_check)
    blocks = commands.add_parser("blocks", help="list the blocks, or show one")
    blocks.add_argument("name", nargs="?", help="a block, or file.py:Block")
    blocks.set_defaults(command=_blocks)
    study = commands.add_parser("study", help="run many variants, grid points and random draws of a diagram")
    _study_options(study)
    study.add_argument("--member", metavar="NAME", help="run this member only, and record its signals")
    study.add_argument("--json", action="store_true", help="print one JSON object for each study and nothing else")
    study.set_defaults(command=_study)
    return parser


def _diagram_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("diagram", type=Path, help="a YAML diagram")
    parser.add_argument("--set", action="append", default=[], metavar="a.b.c=VALUE", help="change one value")
    parser.add_argument("--swap", action="append", default=[], metavar="BLOCK=TYPE", help="another type for a block")
    for name, text in (("stop", "end of the run (s)"), ("step", "communication step (s)"), ("method", "master method")):
        parser.add_argument(f"--{name}", metavar=name.upper(), help=text)


def _study_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("study", type=Path, nargs="+", help="a YAML study")
    parser.add_argument("--set", action="append", default=[], metavar="a.b=VALUE", help="change one value of the study")
    parser.add_argument("--threads", type=int, default=0, metavar="N", help="threads (default: one each processor)")
    parser.add_argument("--dask", default="", metavar="ADDRESS", help="run on a Dask cluster")
    parser.add_argument("--results", type=Path, default=Path("results"), metavar="DIR", help="default: results/")


def _study(options: argparse.Namespace) -> int:
    from cosim.study import command

    return command.study(options)


def _network(options: argparse.Namespace) -> Any:
    from cosim import run

    settings = [f"run.{k}={v}" for k in ("stop", "step", "method") if (v := getattr(options, k)) is not None]
    return run.load(options.diagram, [*options.set, *settings], options.swap)


def _run(options: argparse.Namespace) -> int:
    from cosim import results, terminal
    from cosim.run import Run

    network = _network(options)
    output = options.output or Path("results") / f"{options.diagram.stem}.nc"
    run = Run(network, options.engine, output, options.began)
    previous = results.read_metrics(output) if output.exists() else None
    with terminal.Progress(network.diagram.run.stop) as progress:
        outcome = run.execute(progress.update)
    if options.csv:
        with results.open_result(output) as result:
            results.write_csv(options.csv, result)
    if options.json:
        print(outcome.as_json())
    else:
        _report(outcome, previous)
    if outcome.error:
        terminal.print_errors(outcome.error)
    return EXIT_CODES[outcome.status]


def _report(outcome: Any, previous: dict[str, Any] | None) -> None:
    from cosim import terminal

    terminal.metrics_table(outcome.metrics, previous, outcome.units, outcome.windows)
    for event in outcome.events:
        first = event.times if isinstance(event.times, float) else min(e["time"] for e in event.times)
        terminal.print_warnings([CosimError(f"{event.signal}: {event.text}, first at t = {first:g} s")])
    seconds = ", ".join(f"{name} {value:.3g} s" for name, value in outcome.seconds.items())
    compiled = f", {outcome.kernels_compiled} kernels compiled" if outcome.kernels_compiled else ""
    print(f"\n{outcome.status} after {outcome.steps} steps ({outcome.method}; {seconds}{compiled})")
    print(f"recorded in {outcome.results}")


def _check(options: argparse.Namespace) -> int:
    from cosim import inspection

    inspection.print_network(_network(options))
    return 0


def _blocks(options: argparse.Namespace) -> int:
    from cosim import inspection

    inspection.print_blocks(options.name)
    return 0


if __name__ == "__main__":
    sys.exit(main())
