"""How a signal block is declared: its variables, and functions whose argument names say what they read and write.

A block is a class::

    class Lag(Block):
        '''First-order lag, T dx/dt = u - x.'''

        u = Input("n", description="signal to be smoothed")
        x = State("n", output=True, description="smoothed signal")
        T = Parameter(unit="s", default=1.0, description="time constant")

        def derivatives(u, x, T, d_x):
            d_x[:] = (u - x) / T

Its functions are plain functions over arrays (no `self`), so they can be called alone, in a test or a notebook. What a
function *reads* are the variables that it names; what it *writes*, in place, follows from its kind:

=================  ==========================================================================================
function           writes
=================  ==========================================================================================
``calculate``      the calculated parameters that it names, once, before the first step
``start``          the states that it names, once, from parameters and inputs at time zero
``outputs…``       the outputs and locals that it names and that no function before it writes; any number of such
                   functions, so that direct feedthrough is known per output
``derivatives``    ``d_<state>`` for the continuous states
``update``         ``next_<state>`` for the discrete states, once a period; it comes with the state's value, so that
                   what stays need not be written
``indicators``     the event indicators that it names: where one crosses zero, there is an event
``event``          ``next_<state>`` for the states, also continuous ones, that an event resets; the name of an indicator
                   stands there for how it has crossed: 1 upwards, -1 downwards, 0 not
=================  ==========================================================================================

A scalar that is read comes as a number, one that is written as an array of one element. ``time`` (s) may be named by
any function, and so may ``period`` (s), the diagram's, where the block is sampled. Raising an exception (with constant
arguments) in a function stops the run and names the block, and so does an index out of bounds (a negative one counts
from the end). What is read cannot be written.

A block is sampled where it has an ``update``, or the diagram gives it a ``period``. What ``outputs`` computes at a
sample time is there at that time, as a controller's without delay; a state that ``update`` writes is there a period
later, as that of a controller which computes for as long. Between two samples all that is held.

Numbers are float64, int64 and bool, whatever the width in which a variable is stored, and behave alike to the bit
compiled and interpreted: real numbers as IEEE 754 has them (1/0 is infinite, ``math.sqrt(-1)`` is NaN), integers wrap;
integer division by zero, and a number that its variable cannot hold, stop the run.

Whole arrays are computed with as numpy does: ``d_x[:] = A @ x + B @ u``, ``e = u - x[2:4]``, ``A.T @ e``, ``e *=
0.5``, ``np.zeros(x.size)``, ``np.array([a, b])``, ``np.linalg.solve`` and ``inv`` (of small matrices), ``norm``,
``np.sum``, ``min``, ``max`` and ``mean`` (also along an axis), ``np.where``, ``clip``, ``outer``, ``cross``,
functions of numbers such as ``np.sin`` of each element, and helpers of the module that take and return arrays,
numbers and tuples of them. All that becomes loops in memory that is laid out before the run, the same for both
engines (`cosim.authoring.lowering`). Sizes of new arrays follow from dimensions; arrays that do not fit each other
are a mistake of the text, or stop the run where only the run knows their sizes. An axis is repeated only where it is
of size 1 in the text, as in ``u[:, None] * w``. Random numbers come from a `Stream`, see `cosim.authoring.random`.
What the two engines could not do alike is refused with its line.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from typing import Any, ClassVar

from cosim.authoring.declaration import Declaration
from cosim.authoring.declaring import declare
from cosim.errors import Problems

#: Whether mistakes wait in the declarations until a file has been read to its end.
_waiting: ContextVar[bool] = ContextVar("waiting", default=False)


@contextmanager
def mistakes_wait() -> Iterator[None]:
    """Inside, a class with mistakes is made all the same: whoever imports it asks its declaration."""
    token = _waiting.set(True)
    try:
        yield
    finally:
        _waiting.reset(token)


def _raise_mistakes(declaration: Declaration) -> None:
    from cosim.authoring import authors

    problems = Problems()
    for mistake in (*declaration.mistakes, *authors.mistakes(declaration, complete=False)):
        problems.add(mistake)
    problems.raise_one_or_all()


class Block:
    """Base class of all blocks; see the module's text. ``class B(Block, compiled=False)`` stays plain Python."""

    declaration: ClassVar[Declaration] = Declaration("Block", "")
    measuring: ClassVar[bool] = False

    def __init_subclass__(cls, compiled: bool | None = None, **more: Any) -> None:
        """compiled: as the base class, unless given. Raises: DeclarationError, DiagramErrors with several."""
        super().__init_subclass__(**more)
        inherited = [d for base in cls.__mro__[1:] if isinstance(d := vars(base).get("declaration"), Declaration)]
        cls.declaration = declare(cls, inherited[0].compiled if compiled is None else compiled)
        if not _waiting.get() and (cls.declaration.functions or cls.declaration.mistakes):
            _raise_mistakes(cls.declaration)


class Measure(Block):
    """Base class of measuring blocks: they may tap local variables, and only measures may read their outputs."""

    measuring = True
