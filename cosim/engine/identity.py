"""What a run is, so that none goes on from what another one knew: all that its figures depend on."""

from __future__ import annotations

import platform
from dataclasses import replace
from typing import Any

from cosim.compiling.kernels import Kernels
from cosim.engine import run_key
from cosim.engine.program import Program
from cosim.machine import object_code
from cosim.results.software_versions import versions
from cosim.wiring.network import Network


def identity(network: Network, program: Program, kernels: Kernels, engine: str) -> dict[str, Any]:
    """What a run is, as JSON has it: `key` for all of it, the rest to tell what has changed.

    How long the run waits for who does not answer changes no figure of it.
    """
    waiting = replace(network.diagram, run=replace(network.diagram.run, patience=1.0))
    shared = run_key.structure(replace(network, diagram=waiting), program, kernels)
    triple, processor, features = object_code.host()
    return {
        "key": run_key.key(shared, program, run_key.all_values(network)),
        "diagram": network.diagram.resolved(),
        "code": run_key.code(network, kernels),
        "software": {
            **{name: version for name, version in versions().items() if name != "platform"},
            "cosim's own code": run_key.own_files().hex(),
            "the C library": " ".join(platform.libc_ver()),
            "the system": triple,
            "the processor": processor,
            "the processor's features": features,
            "the engine": engine,
        },
    }
