"""`cosim report`: run studies, and write one HTML file about them."""

from __future__ import annotations

import argparse
from pathlib import Path

from cosim.machine import files
from cosim.plot.style import FORMATS
from cosim.report import document
from cosim.report.document import Pictures
from cosim.terminal import studying
from cosim.terminal.commands.study import study_arguments


def arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    study_arguments(parser)
    help_ = "write each figure as a file too, in formats with commas between (default with --figures: pdf)"
    parser.add_argument("--pictures", type=_formats, default=(), metavar="|".join(FORMATS), help=help_)
    help_ = "where each figure is written as a file, FOLDER/<figure>.pdf (default: results/<study>/)"
    parser.add_argument("--figures", type=Path, metavar="FOLDER", help=help_)
    parser.add_argument("-o", "--output", type=Path, metavar="FILE.html", help="default: results/<study>/report.html")


def run(options: argparse.Namespace) -> int:
    """Run what is not done, and write the report."""
    output = (
        options.output or options.results / (options.study[0].stem if len(options.study) == 1 else "") / "report.html"
    )
    document.refuse_foreign(output)
    files.require_ending(output, "a report", "html", "htm")
    studying.check_folders(options.study)
    formats = options.pictures or (("pdf",) if options.figures else ())
    pictures = Pictures(formats, options.figures, len(options.study) > 1)
    studies = [studying.run(path, options) for path in options.study]
    for file in document.write(output, studies, pictures):
        print(f"drawn in {file}")
    print(f"reported in {output}")
    return max(map(studying.exit_code, studies))


def _formats(text: str) -> tuple[str, ...]:
    found = tuple(dict.fromkeys(part.strip() for part in text.split(",") if part.strip()))
    if not found or not set(found) <= set(FORMATS):
        raise argparse.ArgumentTypeError(f"`{text}` is none of {', '.join(FORMATS)}")
    return found
