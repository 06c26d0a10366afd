"""The loop, as it is compiled. It is the same for all diagrams.

Most diagrams have no algebraic loops, events, tolerances, implicit integrators or histories of inputs, which are two
thirds of its code. Where nothing is in the cache, those get a loop without all that, of the same bits.
"""

from __future__ import annotations

from cosim.compiling import kernels
from cosim.compiling.adapters import raw_source
from cosim.compiling.kernels import ModuleSources
from cosim.master import attempts, histories, integration, loop, newton, rosenbrock
from cosim.master.not_called import not_called

_FUNCTIONS = (loop.run, loop.execute, integration.derive)
#: What is called for those only, by which all their code is reached.
_MORE = (
    *(attempts.attempt, newton.solve, integration.integrate_within_tolerance),
    *(rosenbrock.linearize, rosenbrock.rosenbrock_step, histories.trace, histories.push, histories.forget),
)


def wanted(plain: bool) -> ModuleSources:
    """The loop that a diagram needs.

    plain: whether one without what most diagrams do not need will do; the whole one does, too, where it is found.
    """
    whole = whole_loop()
    return plain_loop() if plain and not kernels.kept(whole) else whole


def whole_loop() -> ModuleSources:
    """The loop of all diagrams."""
    return kernels.raw_sources("engine", _FUNCTIONS)


def plain_loop() -> ModuleSources:
    """The loop without what most diagrams do not need."""
    return ModuleSources("engine-plain", tuple(raw_source("engine", f, _MORE, not_called) for f in _FUNCTIONS))
