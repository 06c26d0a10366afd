"""`cosim export`: write blocks of a diagram as one native FMU."""

from __future__ import annotations

import argparse
from pathlib import Path

from cosim.errors import UnknownBlock
from cosim.machine import files
from cosim.terminal.commands.options import diagram_arguments, load_network


def arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    diagram_arguments(parser)
    parser.add_argument("blocks", nargs="?", default="", help="names joined by commas (default: all blocks)")
    parser.add_argument("-o", "--output", type=Path, metavar="FILE.fmu", help="default: <blocks>.fmu")
    parser.add_argument("--fmi", choices=("2.0", "3.0"), default="3.0", help="version of the standard")
    parser.add_argument("--platform", metavar="P,P", help="such as linux-x86_64,windows-x86_64 (default: this one)")
    parser.add_argument("--member", type=int, default=1, metavar="I", help="whose values are the start values")
    parser.add_argument("--scalars", action="store_true", help="FMI 3 without arrays: x[1], A[1,2] as in FMI 2")
    parser.add_argument("--sources", action="store_true", help="the FMU holds C files too, which compile to the same")
    parser.add_argument(
        "--author", default="", metavar="NAME", help="who made it; this and what follows stands in the FMU"
    )
    parser.add_argument("--model-version", default="", metavar="V", help="version of the model, such as 1.2")
    parser.add_argument("--copyright", default="", metavar="TEXT", help='such as "(C) 2026 A. Author"')
    parser.add_argument("--license", default="", metavar="TEXT", help="its name, such as BSD-3-Clause")
    parser.add_argument("--license-file", type=Path, metavar="FILE", help="its text, which goes into the FMU")
    parser.add_argument(
        "--date", default="", metavar="TIME", help="now, or ISO 8601 (default: SOURCE_DATE_EPOCH, else none)"
    )


def run(options: argparse.Namespace) -> int:
    """Write the FMU and say what is in it."""
    from cosim.export.about import About
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
    about = About(
        author=options.author,
        version=options.model_version,
        copyright=options.copyright,
        license=options.license,
        license_file=options.license_file,
        date=options.date,
    )
    path = export_fmu(
        load_network(options),
        blocks,
        output,
        options.fmi,
        platforms,
        options.member,
        scalars=options.scalars,
        about=about,
        with_sources=options.sources,
    )
    print(f"wrote {path} ({path.stat().st_size / 1024:.0f} kB, FMI {options.fmi})")
    return 0
