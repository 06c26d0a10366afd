"""What a block declares: its variables, by causality, and its dimensions."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, ClassVar

import numpy as np

Unit = str | tuple[str, ...] | None
#: One for all elements, or one for each element of the first axis.
Numbers = float | tuple[float, ...] | None


class OpenDimension(str):
    """The name of an open dimension, which is any number of axes: none where the variable is a scalar.

    It is declared with a question mark, ``"n?"``. What is wired or given says which axes there are; the functions see
    them as one, of 1 for a scalar, elements in row-major order.
    """

    __slots__ = ()


def dimension_of(size: int | str) -> int | str:
    """A size, or the name of a dimension, as a shape is declared with it."""
    return OpenDimension(size[:-1]) if isinstance(size, str) and size.endswith("?") else size


def shape_text(shape: tuple[int | str, ...]) -> str:
    """A declared shape as its author wrote it: `[n?, 3]`; "" for a scalar."""
    return f"[{', '.join(f'{d}?' if isinstance(d, OpenDimension) else str(d) for d in shape)}]" if shape else ""


class Variable:
    """One declared quantity of a block.

    shape: sizes or names of dimensions, () for a scalar; one may be open: see `OpenDimension`. unit: one for all
    elements, or one for each element of the first axis, or None where the block does not care. dtype: one of
    `cosim.authoring.naming.TYPES`; a block that is no author's may have others. finite: a run in which it becomes NaN,
    infinite or as large as `cosim.master.loop.LIMIT` has diverged; False for what means something by NaN or infinity,
    such as a table of events or the distance to nobody.

    nominal, min, max: the usual size of its values, above 0, and their limits, which are allowed themselves; one number
    for all elements, or one for each element of the first axis. A parameter or start value beyond a limit is an error;
    what is computed, or comes by a wire, is not held to it. display: the unit in which it is best shown. An exported
    FMU hands all of them on.

    components: what the elements of the first axis are called, such as ("x", "y", "heading"); pictures name them.
    """

    causality: ClassVar[str]
    any_integer = False  # whether it takes the integer type of the port at the other end, as FMI 2's one type does
    items: Mapping[str, int] = MappingProxyType({})  # of an enumeration: the values that it can have, by name
    structural = False  # whether sizes of ports follow from it

    def __init__(
        self,
        *shape: int | str,
        unit: Unit = None,
        description: str = "",
        dtype: Any = float,
        start: Any = None,
        finite: bool = True,
        nominal: Numbers = None,
        min: Numbers = None,  # noqa: A002  # FMI's words
        max: Numbers = None,  # noqa: A002
        display: Unit = None,
        components: tuple[str, ...] = (),
    ) -> None:
        self.name = ""
        self.shape = tuple(dimension_of(size) for size in shape)
        self.unit = unit
        self.description = description
        self.dtype = np.dtype(dtype)
        self.start = start
        self.finite = finite
        self.nominal = nominal
        self.min = min
        self.max = max
        self.display = display
        self.components = components

    def __set_name__(self, owner: type, name: str) -> None:
        self.name = name

    def __repr__(self) -> str:
        return f"{type(self).__name__} {self.name}{shape_text(self.shape)}"


class Input(Variable):
    """A signal that a wire brings; with `start`, it may stay unconnected and holds that value.

    only: the name of the ports that may be wired to it, whatever their block; "" for any.
    """

    causality = "input"

    def __init__(self, *shape: int | str, only: str = "", **more: Any) -> None:
        super().__init__(*shape, **more)
        self.only = only


class Output(Variable):
    """A signal that other blocks may read. `event`: for a boolean, what to report when it first becomes true.

    held: it jumps where an indicator of the block crosses zero. So it is computed at communication points and events,
    and stays meanwhile: no stage of an integrator looks across a jump.
    """

    causality = "output"

    def __init__(self, *shape: int | str, event: str = "", held: bool = False, **more: Any) -> None:
        super().__init__(*shape, **more)
        self.event = event
        self.held = held


class Local(Variable):
    """A quantity that recordings, measuring blocks and other locals may read, ports may not.

    Also a work space. What the call before has left there may save work, such as a search whose result still holds, but
    may change nothing of what is computed: what is to last is a State. Every element is written, unless it says
    finite=False. held: as of an `Output`.
    """

    causality = "local"

    def __init__(self, *shape: int | str, event: str = "", held: bool = False, **more: Any) -> None:
        super().__init__(*shape, **more)
        self.event = event
        self.held = held


class State(Variable):
    """A continuous state if `derivatives` writes ``d_<name>``, a discrete one if `update` writes ``next_<name>``.

    With `output=True` it is an output too, one without direct feedthrough; else it is local.
    """

    def __init__(self, *shape: int | str, output: bool = False, start: Any = 0.0, **more: Any) -> None:
        super().__init__(*shape, start=start, **more)
        self.output = output

    @property
    def causality(self) -> str:  # type: ignore[override]  # each state has its own
        """FMI causality: ``output`` or ``local``."""
        return "output" if self.output else "local"


class Stream(State):
    """Where a block's random numbers come from, see `cosim.authoring.random`: a discrete state of a key and a count.

    `start` begins it, and `update` draws from ``next_<name>``.
    """

    def __init__(self, description: str = "random numbers: the seed, and how many have been drawn") -> None:
        super().__init__(2, dtype="int64", start=0, description=description)


class Parameter(Variable):
    """A value fixed before the run; without a default, a diagram has to set it.

    misnamed: whether the default was given as `start`, which its author is told when the block is declared.
    """

    causality = "parameter"

    def __init__(self, *shape: int | str, default: Any = None, start: Any = None, **more: Any) -> None:
        super().__init__(*shape, start=default, **more)
        self.misnamed = start is not None


class Seed(Parameter):
    """What tells one stream of random numbers from another: a whole number, which a diagram has to set.

    No two members of a fleet may have the same, nor two blocks: they would draw the same numbers.
    """

    def __init__(self, description: str = "seed of the random numbers, for each member and block another one") -> None:
        super().__init__(dtype="int64", description=description)


class CalculatedParameter(Variable):
    """A value that `calculate` computes once from the parameters."""

    causality = "calculatedParameter"


#: Which crossings of zero are events, and their sign.
CROSSINGS = {"both": 0, "rising": 1, "falling": -1}


class Indicator(Variable):
    """An event indicator: where it crosses zero, from above zero or to above zero, there is an event.

    `indicators` computes it; in `event` its name stands for how it has crossed: 1 upwards, -1 downwards, 0 not.
    crossing: "rising" or "falling" where only that is an event, else "both". terminal: whether the event ends the run.
    """

    causality = "local"

    def __init__(self, *shape: int | str, crossing: str = "both", terminal: bool = False, **more: Any) -> None:
        super().__init__(*shape, **more)
        self.crossing = crossing
        self.terminal = terminal


class Period(Variable):
    """The diagram's `period` (s), where a function names it and the block declares no variable of that name."""

    causality = "calculatedParameter"


def spread(numbers: Numbers, shape: tuple[int, ...], dtype: Any = float) -> np.ndarray | None:
    """A nominal value or a limit for every element of a variable of a shape and type; None where there is none."""
    if numbers is None:
        return None
    array = np.asarray(numbers, dtype)
    return np.broadcast_to(array.reshape(*array.shape, *(1,) * (len(shape) - 1)) if array.shape else array, shape)


@dataclass
class Dimension:
    """A named dimension with a default size, or with as many elements as another one, `of`, less so many.

    Less a negative number is more. An open one may have the axes of the `widest` of several open ones, whose variables
    are combined element by element: all others are of one element, or have the same axes. Names used in shapes without
    this are solved from the wiring.
    """

    default: int | None = None
    description: str = ""
    of: str = ""
    less: int = 0
    widest: tuple[str, ...] = ()
