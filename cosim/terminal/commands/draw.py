"""`cosim draw`: a diagram as a picture of its blocks, ports and wires."""

from __future__ import annotations

import argparse
from pathlib import Path

from cosim.drawing import marks, mermaid, shapes, svg
from cosim.errors import CosimError, Problems
from cosim.language import diagram as diagrams
from cosim.machine import files
from cosim.plot import style
from cosim.terminal.commands.options import diagram_arguments, load_network
from cosim.terminal.screen import say
from cosim.wiring.network import Network

KINDS = ("svg", "png", "pdf", "mmd")


def arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    diagram_arguments(parser)
    parser.add_argument("-o", "--output", type=Path, metavar="FILE", help="a .svg, .png, .pdf, or Mermaid's .mmd")
    help_ = "mark what differs from this diagram (default: what it extends, or was before --set and --swap)"
    parser.add_argument("--beside", type=Path, metavar="A.yaml", help=help_)
    parser.epilog = "Without -o, an SVG beside where the command runs, called as the diagram."


def run(options: argparse.Namespace) -> int:
    """Draw it."""
    output = options.output or Path(f"{options.diagram.stem}.svg")
    kind = style.kind_of(output, KINDS, "drawings")
    network = load_network(options)
    changed = _changed(network, options)
    if kind in style.FORMATS and kind != "svg":
        from cosim.drawing import printed  # with matplotlib

        style.save(printed.figure(shapes.drawing(network, changed)), output)
    else:
        made = mermaid.mermaid(network, changed) if kind == "mmd" else svg.svg(shapes.drawing(network, changed))
        _write(made, output)
    say(f"{len(network.components)} blocks drawn in {output}" + (f"; marked: {', '.join(changed)}" if changed else ""))
    return 0


def _changed(network: Network, options: argparse.Namespace) -> list[str]:
    """The blocks that differ from what the diagram was before its uppermost layer.

    That may lack what the layer brings, so that it is read and not wired. Raises: DiagramErrors.
    """
    extended = network.diagram.extended[:1]
    changes = [options.diagram] if options.set or options.swap else extended
    before = next(iter([options.beside] if options.beside else changes), None)
    if before is None:
        return []
    return marks.changed(network.diagram, diagrams.load(before, problems=Problems()))


def _write(text: str, output: Path) -> None:
    files.refuse_foreign(output, "a drawing of this program", _is_ours)
    try:
        output.parent.mkdir(parents=True, exist_ok=True)
        with files.fresh(output) as new:
            new.write_text(text, encoding="utf-8")
    except OSError as error:
        message = f"cannot write {output}: {error.strerror or error}"
        raise CosimError(message, fix=files.usual_fix(error)) from None


def _is_ours(path: Path) -> bool:
    with path.open("rb") as file:
        return svg.MARK.encode() in file.read(style.MARKED)
