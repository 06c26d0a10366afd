"""Typed errors, one class for each mistake, each knowing where in the YAML it was made and the usual fix."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from difflib import SequenceMatcher, get_close_matches
from pathlib import Path
from string import digits
from typing import Any


@dataclass(frozen=True)
class Position:
    """A place in a text file; line and column count from 1."""

    file: str
    line: int = 0
    column: int = 0

    def __str__(self) -> str:
        return f"{self.file}:{self.line}:{self.column}" if self.line else self.file

    @property
    def folder(self) -> Path:
        """The folder that paths written there are relative to: of the file, or the current one."""
        return Path(self.file).parent if self.line else Path()


@dataclass(frozen=True)
class KeyPath(Position):
    """A place in what a program gives, told as the path of its keys; base: the folder that paths are relative to.

    file: who gives it, in a word.
    """

    keys: str = ""
    base: str = ""

    def __str__(self) -> str:
        return self.keys

    @property
    def folder(self) -> Path:
        """As of `Position`."""
        return Path(self.base)


class CosimError(Exception):
    """Anything that a user of the framework can put right: what is wrong, where, and the usual fix.

    others: further places at which the same is wrong, which the message names. run: what there is of the run that it
    ended, where it is raised to a program.
    """

    others: tuple[Position, ...] = ()
    run: Any = None

    def __init__(self, message: str, position: Position | None = None, fix: str = "") -> None:
        super().__init__(message)
        self.message = message
        self.position = position
        self.fix = fix

    @property
    def each(self) -> list[CosimError]:
        """It, or those that it holds."""
        found: list[CosimError] = getattr(self, "errors", [self])
        return found

    def __str__(self) -> str:
        where = f"{self.position}: " if self.position else ""
        fix = f"\n    fix: {self.fix}" if self.fix else ""
        return f"{where}{self.message}{fix}"


class DiagramErrors(CosimError):
    """All mistakes found in one diagram, in the order of their places."""

    def __init__(self, errors: Iterable[CosimError]) -> None:
        self.errors = list(errors)
        super().__init__("\n".join(str(error) for error in self.errors))


class YamlSyntaxError(CosimError):
    """The file is not well-formed YAML."""


class DuplicateKey(CosimError):
    """A mapping has the same key twice."""


class MissingFile(CosimError):
    """A file that the diagram or the command line names does not exist or cannot be read."""


class WrongFile(CosimError):
    """A file of another kind than the command takes: a study for a diagram, or a diagram for a study."""


class CircularExtends(CosimError):
    """An overlay extends itself, at once or through others."""


class UnknownKey(CosimError):
    """A key that the diagram's grammar does not have at this place."""


class MissingKey(CosimError):
    """A key that the diagram's grammar requires at this place."""


class WrongType(CosimError):
    """A value of the wrong kind: text where a number is needed, a list where a mapping is needed."""


class WrongValue(CosimError):
    """A value of the right kind that is out of its range, such as a step of zero."""


class TooLarge(CosimError):
    """A count, a file or a run that is larger than there is memory for, or than anybody can wait for."""


class ExpressionError(CosimError):
    """An arithmetic expression that cannot be read or evaluated. offset: where in its text, in characters."""

    offset = 0

    def at(self, offset: int) -> ExpressionError:
        """The same, said of what stands at an offset."""
        self.offset = offset
        return self


class UnknownSetting(CosimError):
    """A --set, --swap or similar option that names nothing in the diagram."""


class UnknownBlock(CosimError):
    """A block type that no library has."""


class AmbiguousBlock(CosimError):
    """A block type that two modules of the libraries have."""


class BlockImportError(CosimError):
    """A Python file of blocks that cannot be imported."""


class DeclarationError(CosimError):
    """A block class whose declaration contradicts itself."""


class UnknownPort(CosimError):
    """An input, output or variable that the block does not have."""


class UnknownParameter(CosimError):
    """A parameter or start value that the block does not have."""


class MissingParameter(CosimError):
    """A parameter without a default that the diagram does not set."""


class UnconnectedInput(CosimError):
    """An input with neither a source nor a start value."""


class NotWirable(CosimError):
    """A wire from a local variable or a measuring block, which only recordings and measuring blocks may read."""


class WrongShape(CosimError):
    """A signal or value whose shape does not fit the port, parameter or state."""


class UnsolvedDimension(CosimError):
    """A named dimension that neither wires nor values determine."""


class WrongUnit(CosimError):
    """A wire between two ports whose units differ."""


class WrongDataType(CosimError):
    """A wire between two ports whose data types differ."""


class DroppedValue(CosimError):
    """Something that the diagram gives a block and that the type which replaces the block's own does not take."""


class TwoDrivers(CosimError):
    """One port driven by two sources."""


class UnknownFleet(CosimError):
    """A `per:` that names no fleet."""


class FleetMismatch(CosimError):
    """A list for each member of a fleet whose length is not the fleet's size."""


class AlgebraicLoop(CosimError):
    """Outputs that depend on each other at the same instant."""


class RuleViolation(CosimError):
    """A parameter that breaks a rule stated by its block."""


class KernelError(CosimError):
    """A function of a block that the compiler cannot turn into a kernel."""


class BlockFailed(CosimError):
    """A block's function stopped the run."""


class FmuFailed(BlockFailed):
    """A function of an FMU stopped the run."""


class FmuCrashed(FmuFailed):
    """The process that an FMU ran in has died."""


class FmuHung(FmuFailed):
    """A function of an FMU did not return within the run's patience."""


class Terminated(CosimError):
    """A block asked for the end of the simulation, which is no failure, but the run is shorter than it was to be."""


class ArchiveError(CosimError):
    """An FMU file that is no sound archive, or tries to do harm."""


class FmuError(CosimError):
    """An FMU that cannot be run here, because of its version, kind, platform or description."""


class TooManyInstances(CosimError):
    """More instances of a block than one process may have."""


class Diverged(CosimError):
    """A state became NaN or infinite."""


class UsageError(CosimError):
    """A command line that asks for what there is not."""


class ResultError(CosimError):
    """A result file that cannot be written or read."""


class CheckpointError(CosimError):
    """A checkpoint that cannot be made or read, or is of another run than the one that is to go on from it."""


class NothingToResume(CheckpointError):
    """A run that has come to its end; status: as of `Outcome`."""

    def __init__(self, message: str, status: str) -> None:
        super().__init__(message)
        self.status = status


class MetricError(CosimError):
    """A metric whose signal, reduction or time window does not make sense."""


class FormulaError(CosimError):
    """A formula of a requirement that cannot be read, or does not fit the signals it names."""


class NoCertificate(CosimError):
    """A diagram whose accuracy nobody can tell, as a run with another step does not come to its end."""


class MissingPackage(CosimError):
    """A package that a feature needs, and that is not installed."""


class ChangedFile(CosimError):
    """A file that is no longer what it was when a program loaded it."""


class PlotError(CosimError):
    """A picture that cannot be drawn from what a result holds."""


class ClusterError(CosimError):
    """A Dask cluster that cannot be reached or used."""


class NoAcceptedDraw(CosimError):
    """Random draws of a study of which none satisfies its conditions."""


class NotExportable(CosimError):
    """A block that cannot become an FMU."""


class CompilerMissing(CosimError):
    """No C compiler for a platform that an FMU is to be built for."""


class BuildFailed(CosimError):
    """The C compiler or linker refused an FMU's code."""


_MOST_PLACES = 8
_LONGEST_NAME, _MOST_NAMES = 200, 2000  # the time to compare them grows with both


def nearest(name: str, known: Iterable[str], lead: str = "did you mean") -> str:
    """The usual fix for a misspelt name: the nearest known one, else all of them, where these are not too many."""
    names = sorted(known)
    if len(name) > _LONGEST_NAME or len(names) > _MOST_NAMES:
        return ""
    for close in get_close_matches(name, names, n=1, cutoff=0.5):
        numbered = [other for other in names if other.rstrip(digits) == close.rstrip(digits)]
        return f"{lead} `{max(numbered, key=lambda other: SequenceMatcher(None, other, name).ratio())}`?"
    return f"one of: {', '.join(names)}" if names else ""


class Problems:
    """Collects mistakes, so that all of a file are reported in one go."""

    def __init__(self) -> None:
        self.errors: list[CosimError] = []

    def add(self, error: CosimError) -> None:
        """Keep a mistake, or each that it holds."""
        self.errors.extend(e for e in error.each if str(e) not in {str(known) for known in self.errors})

    def attempt(self, stage: Callable[..., Any], *arguments: Any) -> Any:
        """What a stage returns; None if it raises a mistake, which is kept."""
        try:
            return stage(*arguments)
        except CosimError as error:
            self.add(error)
            return None

    def raise_if_any(self) -> None:
        """Raise `DiagramErrors` with all mistakes in the order of file, line and column."""
        if self.errors:
            raise DiagramErrors(self.sorted())

    def raise_one_or_all(self) -> None:
        """Raise the mistake itself where there is one only, else as `raise_if_any`."""
        if len(self.errors) == 1:
            raise self.errors[0]
        self.raise_if_any()

    def sorted(self) -> list[CosimError]:
        """The mistakes in the order of file, line and column; a name that is missed several times is one."""
        found: dict[str, list[CosimError]] = {}
        for error in sorted(self.errors, key=_place):
            found.setdefault(_wrong_name(error) or str(error), []).append(error)
        return [_one(errors) for errors in found.values()]


def _wrong_name(error: CosimError) -> str:
    """What is said of a name that may be wrong at many places, whoever says it; "" for any other mistake."""
    if isinstance(error, UnknownSetting):
        return error.message
    told = error.message.partition("`: ")[2] if error.message.startswith("block `") else ""
    return told if isinstance(error, UnknownBlock | AmbiguousBlock) else ""


def _one(errors: list[CosimError]) -> CosimError:
    """The first of mistakes that differ in their places only, with the places of the others."""
    first, *others = errors
    if not others:
        return first
    file = first.position.file if first.position else ""
    others_at = listed_places([error.position for error in others if error.position], file)
    return type(first)(f"{first.message}, also at {others_at}", first.position, first.fix)


def listed_places(places: Iterable[Position], file: str) -> str:
    """The first of several places; of those in a file, line and column alone."""
    words = [f"{p.line}:{p.column}" if p.file == file and p.line else str(p) for p in places]
    return ", ".join(words[:_MOST_PLACES]) + (", …" if len(words) > _MOST_PLACES else "")


def _place(error: CosimError) -> tuple[str, int, int]:
    place = error.position
    return (place.file, place.line, place.column) if place else ("", 0, 0)
