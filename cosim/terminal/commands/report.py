"""`cosim report`: run studies, and write one HTML file about them."""

from __future__ import annotations

import argparse
from pathlib import Path

from cosim.machine import files
from cosim.plot.style import FORMATS
from cosim.report import document
from cosim.terminal import studying
from cosim.terminal.commands.study import study_arguments


def arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    study_arguments(parser)
    help_ = "write each figure as a file too, results/<study>/<figure>.FORMAT"
    parser.add_argument("--pictures", choices=FORMATS, default="", metavar="|".join(FORMATS), help=help_)
    parser.add_argument("-o", "--output", type=Path, metavar="FILE.html", help="default: results/<study>/report.html")


def run(options: argparse.Namespace) -> int:
    """Run what is not done, and write the report."""
    output = (
        options.output or options.results / (options.study[0].stem if len(options.study) == 1 else "") / "report.html"
    )
    document.refuse_foreign(output)
    files.require_ending(output, "a report", "html", "htm")
    studying.check_folders(options.study)
    studies = [studying.run(path, options) for path in options.study]
    document.write(output, studies, options.pictures)
    print(f"reported in {output}")
    return max(map(studying.exit_code, studies))
