"""Which packages a wheel holds; everything else stands in pyproject.toml.

The blocks lie at the top of the source tree, where people look for them. They are imported and installed as
`cosim.blocks`, so that nobody's own `blocks` is in the way.
"""

from setuptools import find_packages, setup

setup(
    packages=[*find_packages(include=["cosim", "cosim.*"]), "cosim.blocks"],
    package_dir={"cosim.blocks": "blocks"},
)
