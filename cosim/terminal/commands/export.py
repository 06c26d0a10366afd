"""`cosim export`: write blocks of a diagram as one native FMU."""

from __future__ import annotations

import argparse
from pathlib import Path

from cosim.errors import CosimError, UnknownBlock
from cosim.machine import files
from cosim.terminal import screen
from cosim.terminal.commands.options import diagram_arguments, load_network
from cosim.wiring.network import Network


def arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    diagram_arguments(parser)
    parser.add_argument("blocks", nargs="?", default="", help="names joined by commas (default: all blocks)")
    parser.add_argument("-o", "--output", type=Path, metavar="FILE.fmu", help="default: <blocks>.fmu")
    parser.add_argument("--fmi", choices=("2.0", "3.0"), default="3.0", help="version of the standard")
    parser.add_argument("--platform", metavar="P,P", help="such as linux-x86_64,windows-x86_64 (default: this one)")
    parser.add_argument("--member", type=int, default=1, metavar="I", help="whose values are the start values")


def run(options: argparse.Namespace) -> int:
    """Write the FMU and say what is in it."""
    from cosim.export.exporter import export_fmu, refuse_foreign

    blocks = [name for name in options.blocks.split(",") if name]
    if options.blocks and not blocks:
        raise UnknownBlock(
            f"`{options.blocks}` names no block", fix="names joined by commas, or nothing for all blocks"
        )
    output = options.output or Path(f"{'_'.join(blocks) or options.diagram.stem}.fmu")
    refuse_foreign(output)
    files.require_ending(output, "an FMU", "fmu")
    platforms = options.platform.split(",") if options.platform else None
    network = load_network(options)
    path = export_fmu(network, blocks, output, options.fmi, platforms, options.member)
    print(f"wrote {path} ({path.stat().st_size / 1024:.0f} kB, FMI {options.fmi})")
    if unbounded := _unbounded(network, blocks):
        names = ", ".join(f"`{name}`" for name in unbounded)
        screen.print_warnings(
            [CosimError(f"{names} may be NaN or infinite, which cosim and other importers refuse of an FMU")]
        )
    return 0


def _unbounded(network: Network, blocks: list[str]) -> list[str]:
    """The exported outputs that mean something by NaN or infinity."""
    components = [component for name, component in network.components.items() if not blocks or name in blocks]
    variables = [(s.name, v) for s in components for v in s.declaration.variables.values()]
    return [f"{block}.{v.name}" for block, v in variables if v.causality == "output" and not v.finite]
