"""Which packages a wheel holds; everything else stands in pyproject.toml.

The blocks lie at the top of the source tree, where people look for them. They are imported and installed as
`cosim.blocks`, so that nobody's own `blocks` is in the way. The diagrams beside them are installed as `cosim/diagrams`,
from where `cosim init --examples` takes them.
"""

from setuptools import find_packages, setup

setup(
    packages=[*find_packages(include=["cosim", "cosim.*"]), "cosim.blocks", "cosim.diagrams"],
    package_dir={"cosim.blocks": "blocks", "cosim.diagrams": "diagrams"},
)
