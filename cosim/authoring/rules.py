"""Rules that every diagram has to keep, and conditions of theorems, which are shown with their numbers."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

Verdict = bool | None | tuple[bool | None, str]


@dataclass(frozen=True)
class Course:
    """What a variable of one member did along a run: its extremes over all steps and elements, and when (s)."""

    smallest: float
    smallest_at: float
    largest: float
    largest_at: float


@dataclass
class Rule:
    """A condition on a block's parameters: violated, it is an error, or a warning where `warning` is set.

    The function may name parameters, dimensions and inputs (which come as the `Source` at the other end of the
    wire), and returns whether the rule holds, or that and a text with its numbers. A condition may also name `stop`,
    the run's end (s), `method`, the run's, and what its block computes, which comes as a `Course`: then it is judged
    after a run. It may return None for "holds": nobody can say. Anything but True, False or that is a mistake.
    """

    text: str
    source: str
    function: Callable[..., Verdict]
    warning: bool = False

    @cached_property
    def arguments(self) -> tuple[str, ...]:
        """What the rule's function names."""
        return tuple(inspect.signature(self.function).parameters)


def rule(text: str, source: str = "") -> Callable[[Callable[..., Any]], Rule]:
    """Decorate a function of parameters as a rule that every diagram has to keep."""
    return lambda function: Rule(text, source, function)


def condition(text: str, source: str = "") -> Callable[[Callable[..., Any]], Rule]:
    """Decorate a function as a condition of a theorem: `cosim check` shows its numbers and warns where it fails.

    One that names outputs, locals or states of its block is judged along a run: `cosim run` warns where it failed.
    """
    return lambda function: Rule(text, source, function, warning=True)
