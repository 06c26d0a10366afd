"""What a new project begins with: a diagram, its blocks, a test, a study, settings for editors, a page to read.

Or the framework's own diagrams, to be changed.
"""

from __future__ import annotations

import json
from functools import partial
from pathlib import Path

from cosim.language import schema
from cosim.language.keys import DIAGRAM
from cosim.project.new_files import Content, template, write_all
from cosim.study.study_keys import STUDY
from cosim.wiring.block_schema import block_types

_FILES = {
    "README.md": "readme.txt",
    "diagrams/motor.yaml": "motor_diagram.txt",
    "blocks/motor.py": "motor_block.txt",
    "blocks/proportional_controller.py": "controller_block.txt",
    "studies/gains.yaml": "gains_study.txt",
    "tests/test_motor.py": "motor_test.txt",
}
_EDITOR = {
    "glspc.server.command": "cosim",
    "glspc.server.commandArguments": ["lsp"],
    "glspc.server.languageId": ["yaml"],
    "yaml.schemas": {
        ".vscode/diagram.schema.json": ["diagrams/*.yaml"],
        ".vscode/study.schema.json": ["studies/*.yaml"],
    },
}
SCHEMAS = {"diagram": (DIAGRAM, "A diagram of cosim"), "study": (STUDY, "A study of cosim")}


def begin(folder: Path) -> list[Path]:
    """Write a project into a folder, which may be there; its files. Raises: UsageError, OSError."""
    title = " ".join(folder.resolve().name.split()) or "Project"
    files: dict[str, Content] = {
        **{name: template(text, title=title) for name, text in _FILES.items()},
        **{f".vscode/{name}.schema.json": partial(schema_text, name, folder) for name in SCHEMAS},
        ".vscode/settings.json": json.dumps(_EDITOR, indent=2) + "\n",
        ".vscode/extensions.json": json.dumps({"recommendations": ["zsol.vscode-glspc"]}, indent=2) + "\n",
        ".gitignore": "results/\n__pycache__/\n",
    }
    write_all({folder / name: text for name, text in files.items()})
    return [folder / name for name in files]


def examples(folder: Path) -> list[Path]:
    """Write the framework's own diagrams and studies into a folder; its files. Raises: UsageError, OSError."""
    package = Path(__file__).parents[1]
    places = (package / "diagrams", package.parent / "diagrams")  # as installed, and in a clone
    source = next(place for place in places if place.is_dir())
    found = {path.relative_to(source): path for path in sorted(source.rglob("*.yaml"))}
    write_all({folder / name: path.read_text(encoding="utf-8") for name, path in found.items()})
    return [folder / name for name in found]


def schema_text(name: str, folder: Path) -> str:
    """The JSON Schema of a kind of file, of SCHEMAS, with the blocks of the libraries and of a project's folder."""
    return schema.text(schema.json_schema(*SCHEMAS[name], block_types(folder)))
