"""How Sphinx makes the documentation: ``sphinx-build -W docs build/docs``, with `pip install -e '.[docs]'`."""

import re
import sys
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parent))

import reference_pages

import cosim

project = "cosim"
author = "the cosim authors"
project_copyright = ""
version = release = cosim.__version__

extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon"]
exclude_patterns = ["build"]
myst_enable_extensions = ["colon_fence", "dollarmath", "deflist"]
myst_heading_anchors = 3
autodoc_typehints = "description"
autodoc_member_order = "bysource"
default_role = "code"
nitpicky = False

html_theme = "furo"
html_title = "cosim"
html_static_path = ["static"]
html_css_files = ["wide.css"]
html_show_copyright = False
html_show_sphinx = False
pygments_style = "friendly"
pygments_dark_style = "monokai"


def _captioned(app: Any, page: str, source: list[str]) -> None:
    """Show the name of a file above it, of which ```yaml file=name tells the tests."""
    del app, page
    source[0] = re.sub(r"^```(\w+) file=(\S+)$", r"```{code-block} \1\n:caption: \2\n", source[0], flags=re.MULTILINE)


def setup(app: Any) -> None:
    """Write the pages that come from declarations before any is read."""
    app.connect("builder-inited", lambda app: reference_pages.write(Path(app.srcdir) / "reference"))
    app.connect("source-read", _captioned)
