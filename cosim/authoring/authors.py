"""What an author's functions may say: checked on their source before they run or are compiled.

A function writes its results in place, on every path; it changes nothing else, returns nothing, and does what
compiled code and Python do alike. Where the source cannot be read (text given to `exec`, an old interactive prompt),
rebound arguments and returned values are found in the bytecode, and the rest is not checked.
"""

from __future__ import annotations

import ast
import builtins
import dis
from collections.abc import Iterable, Iterator
from types import FunctionType, ModuleType
from typing import Any, cast

from cosim.authoring import naming
from cosim.authoring.author_source import Text, arguments_of, function_text, shown
from cosim.authoring.dataflow.effects import Effects, LeftOut
from cosim.authoring.dataflow.following import effects
from cosim.authoring.declaration import PREFIXES, Declaration, Function, is_scalar, variable_of
from cosim.authoring.lowering.block_functions import refusals
from cosim.authoring.scope import scope_of
from cosim.authoring.shared_operations import unshared
from cosim.authoring.variables import Local, State, Variable
from cosim.errors import CosimError, DeclarationError, Position, Problems, nearest

#: What a written argument is, in words, by its causality.
_WRITTEN = {"output": "output", "local": "local", "calculatedParameter": "calculated parameter"}


def check(declarations: Iterable[Declaration], only: Function | None = None) -> None:
    """Raises: DeclarationError, DiagramErrors with several: the mistakes in the functions of blocks, or in one."""
    problems = Problems()
    for declaration in declarations:
        for mistake in _of_function(declaration, only, complete=True) if only else mistakes(declaration):
            problems.add(mistake)
    problems.raise_one_or_all()


def mistakes(declaration: Declaration, complete: bool = True) -> list[CosimError]:
    """Every mistake in a block's functions, in the order of their places.

    complete: whether the module of the block has been read to its end, so that all its names are known.
    """
    found = Problems()
    if declaration.foreign:  # whose functions are no author's
        return []
    for mistake in naming.twice(declaration.home, declaration.variables) if declaration.home else ():
        found.add(mistake)
    for function in declaration.functions:
        for mistake in _of_function(declaration, function, complete):
            found.add(mistake)
    return found.sorted()


def _of_function(declaration: Declaration, function: Function, complete: bool) -> Iterator[DeclarationError]:
    text = function_text(function.python)
    if text is None:
        yield from _from_bytecode(function)
        return
    shapes = [_shape(declaration, function, a) for a in function.arguments]
    found = effects(function.python, shapes)
    assert found is not None
    about = _Reporter(declaration, function, text)
    if about.is_left_to_others():
        yield about.left_to_others()
        return
    yield from about.of_effects(found)
    yield from about.of_names(complete)
    if declaration.compiled:
        refused, handled = refusals(declaration, function, complete)
        wrong = [(where, refusal.node, refusal.what, refusal.fix) for where, refusal in refused]
        for where, node, what, fix in (*unshared(function.python, handled), *wrong):
            by = "" if where.node is text.node else f", called by {about.name}"
            who = about.name if not by else f"{where.node.name}()"
            yield DeclarationError(f"{who}{by}: {what}", where.place(node), fix)
    yield from about.of_numbers(shapes)
    for node in ast.walk(text.node):
        if isinstance(node, ast.Global | ast.Nonlocal):
            what = f"keeps `{', '.join(node.names)}` outside itself"
            yield about.mistake(node, what, "keep what is to last in a State, so that every run begins alike")


def _shape(declaration: Declaration, function: Function, argument: str) -> tuple[Any, ...]:
    """The shape of an argument as the function sees it; names for sizes that are not known."""
    if argument == "time" or argument not in {*declaration.variables, *function.writes}:
        return ()
    variable = variable_of(declaration, argument)
    return () if is_scalar(variable, function, argument) else variable.shape or (1,)


class _Reporter:
    """Puts what a function does into words."""

    def __init__(self, declaration: Declaration, function: Function, text: Text) -> None:
        self.declaration = declaration
        self.function = function
        self.text = text
        self.name = called(function)

    def mistake(self, node: Any, what: str, fix: str) -> DeclarationError:
        """A mistake at a node of the function."""
        return DeclarationError(f"{self.name} {what}", self.text.place(node), fix)

    def is_left_to_others(self) -> bool:
        """Whether a base class says in words alone what the function is to write."""
        home, body = self.declaration.home, self.text.node.body
        inherited = home is not None and self.function.python.__qualname__.rpartition(".")[0] != home.__qualname__
        return inherited and len(body) == 1 and ast.get_docstring(self.text.node) is not None

    def left_to_others(self) -> DeclarationError:
        """What the block's author forgot to define."""
        name, arguments = self.function.name, ", ".join(self.function.arguments)
        message = f"block {self.declaration.name} defines no {name}(), which its base class leaves to it"
        fix = f"write `def {name}({arguments}):` in it. {ast.get_docstring(self.text.node)}"
        return DeclarationError(message, naming.place_in(self.declaration.home, name), fix)

    def of_effects(self, found: Effects) -> Iterator[DeclarationError]:
        """What it writes, rebinds, returns and reads too early, and what it may leave unwritten."""
        writes = self.function.writes
        for place in found.rebound:
            if place.name in writes:
                what = (
                    f"gives the name `{place.name}` to another value, which does not reach the {self.kind(place.name)}"
                )
                yield self.mistake(place.node, what, f"write into it: {self.element(place.name)} = …")
            else:
                what = f"gives the name `{place.name}`, {self.article(place.name)}, to another value"
                yield self.mistake(place.node, what, self.instead(place.name) or "use another name for the new value")
        renamed = {place.name for place in found.rebound}  # of which the mistake is told above
        for place in found.maybe:
            if place.name not in writes and _base_of(place.node) not in renamed - {place.name}:
                what = f"writes `{place.name}`, {self.article(place.name)}, which it may only read"
                yield self.mistake(place.node, what, self.instead(place.name) or "write to a Local or to a local name")
        for node in found.returned:
            wanted = min(self.required() or writes, default="y")
            what = "returns a value, which goes nowhere"
            yield self.mistake(node, what, f"write it in place: {self.element(wanted)} = …")
        if self.function.kind not in ("update", "event", "start"):
            for place in found.stale:
                if place.name in self.required() or self.keeps(place.name):
                    what = f"reads `{place.name}` before it is written, when it holds what an earlier call left"
                    fix = f"write it first, such as {self.element(place.name)} = 0.0"
                    yield self.mistake(place.node, what, fix)
        yield from self.unwritten(found)

    def keeps(self, name: str) -> bool:
        """Whether a work space is read where it is written next, and nothing was put into it before in the call."""
        mentions = [
            n for n in ast.walk(self.text.node) if isinstance(n, ast.Subscript) and ast.unparse(n.value) == name
        ]
        updated = [n.target for n in ast.walk(self.text.node) if isinstance(n, ast.AugAssign)]
        writes = [n for n in mentions if isinstance(n.ctx, ast.Store)]
        reads = [n for n in mentions if isinstance(n.ctx, ast.Load) or n in updated]
        first = min((n.lineno for n in writes), default=0)
        return any(
            read.lineno <= first and any(ast.unparse(read.slice) == ast.unparse(write.slice) for write in writes)
            for read in reads
        )

    def unwritten(self, found: Effects) -> Iterator[DeclarationError]:
        """Results that some path does not write, and work space that no statement does."""
        rebound = {p.name for p in found.rebound}
        arguments = {a.arg: a for a in arguments_of(self.text.node)}
        for name in self.function.arguments:
            if name not in self.function.writes or name in rebound:
                continue
            if name in found.surely:
                if name in found.left_out and name in self.required():
                    yield self.left_out(name, found.left_out[name])
                continue
            node, kind = arguments[name], self.kind(name)
            if name not in found.touched:
                fix = f"write it, such as {self.element(name)} = …, or do not name it"
                yield self.mistake(node, f"never writes `{name}`, the {kind} that it names", fix)
            elif name in found.partly and name in self.required():
                left = ", ".join(f"{name}[{', '.join(map(str, index))}]" for index in found.partly[name])
                yield self.mistake(node, f"may leave {left} of the {kind} unwritten", f"write {left} on every path")
            elif name in self.required():
                what = (
                    f"may leave `{name}` unwritten: there is a path on which the {kind} keeps what an earlier call left"
                )
                yield self.mistake(node, what, f"write it on every path, such as {self.element(name)} = 0.0 at the top")

    def left_out(self, name: str, left: LeftOut) -> DeclarationError:
        """An element that no loop reaches."""
        axes = len(variable_of(self.declaration, name).shape)
        element = f"{name}[{', '.join([':'] * left.axis + [str(left.index)])}]"
        size = f"{name}.size" if axes < 2 else f"{name}.shape[{left.axis}]"
        what = f"may leave `{name}` unwritten: {element}, which this loop does not reach, keeps what it was"
        return self.mistake(left.loop, what, f"loop over range({size}), or write {element} too")

    def required(self) -> frozenset[str]:
        """What has to be written on every path: all but arrays of work space, and what comes with the state's value."""
        if self.function.kind in ("update", "event"):
            return frozenset()
        variables = self.declaration.variables
        return frozenset(n for n in self.function.writes if not _is_work_space(variables.get(n)))

    def of_names(self, complete: bool) -> Iterator[DeclarationError]:
        """Names that stand for nothing, and local names that hide a variable of the block."""
        code = self.function.python.__code__
        scope = scope_of(cast("FunctionType", self.function.python))
        own = set(code.co_varnames) | set(code.co_cellvars) | set(code.co_freevars)
        declared = self.declaration.variables
        meant = {*declared, *(f"d_{s.name}" for s in self.declaration.of(State))}
        meant |= {f"next_{s.name}" for s in self.declaration.of(State)} | {"time"}
        reported = set()
        for node in ast.walk(self.text.node):
            if not isinstance(node, ast.Name) or node.id in self.function.arguments or node.id in reported:
                continue
            name, stored = node.id, not isinstance(node.ctx, ast.Load)
            if stored and name in meant and name in own:
                reported.add(name)
                what = f"gives a value to a name of its own, `{name}`, which is also a variable of the block"
                yield self.mistake(node, what, f"name `{name}` as an argument to write it, or use another name")
            elif name in meant and name not in own and name not in scope and name not in vars(builtins):
                reported.add(name)
                what = f"uses `{name}`, a variable of the block that it does not name as an argument"
                yield self.mistake(node, what, f"add `{name}` to the arguments of {self.function.name}()")
            elif name in declared and name not in own and _is_data(scope.get(name)):
                reported.add(name)
                what = f"uses `{name}` of the module, not the variable `{name}` of the block"
                yield self.mistake(
                    node, what, f"add `{name}` to the arguments of {self.function.name}(), or rename one"
                )
            elif complete and name not in own and name not in scope and name not in self.arguments_of_inner():
                reported.add(name)
                known = {*self.function.arguments, *own, *meant, *self.function.python.__globals__}
                fix = nearest(name, {k for k in known if not k.startswith("_")}) if len(name) > 2 else ""
                yield self.mistake(
                    node, f"uses `{name}`, which is defined nowhere", fix or "define it, or correct the name"
                )

    def of_numbers(self, shapes: list[tuple[Any, ...]]) -> Iterator[DeclarationError]:
        """Scalars that are read with an index, though they come as numbers."""
        numbers = {a for a, shape in zip(self.function.arguments, shapes, strict=True) if shape == ()}
        for node in ast.walk(self.text.node):
            if isinstance(node, ast.Subscript) and isinstance(node.ctx, ast.Load):
                name = getattr(node.value, "id", "")
                if name in numbers:
                    what = f"takes an element of `{name}`, {self.article(name)}, which is a number"
                    yield self.mistake(node, what, f"write `{name}` without an index, or declare it with a shape")

    def arguments_of_inner(self) -> set[str]:
        """Names of functions, comprehensions and the like inside this one."""
        found = set()
        for node in ast.walk(self.text.node):
            if isinstance(node, ast.arg):
                found.add(node.arg)
            elif isinstance(node, ast.Name) and not isinstance(node.ctx, ast.Load):
                found.add(node.id)
        return found

    def kind(self, name: str) -> str:
        """What a written argument is, in words."""
        if name not in self.declaration.variables:
            return "derivative" if self.function.kind == "derivatives" else "next value"
        variable = self.declaration.variables[name]
        return "state" if isinstance(variable, State) else _WRITTEN[variable.causality]

    def article(self, name: str) -> str:
        """What a read argument is, in words."""
        if name == "time":
            return "the simulated time"
        variable = self.declaration.variables.get(name)
        if variable is None:
            return "no variable of the block"
        if isinstance(variable, State):
            return "a state"
        words = {"input": "an input", "parameter": "a parameter", "calculatedParameter": "a calculated parameter"}
        return words.get(variable.causality) or f"an {variable.causality}".replace("an local", "a local")

    def instead(self, name: str) -> str:
        """What the author most likely wanted to write."""
        variable = self.declaration.variables.get(name)
        prefix = PREFIXES.get(self.function.kind)
        if isinstance(variable, State) and prefix:
            return f"write {prefix}{name}[…], and name it as an argument"
        writer = next((f for f in self.declaration.functions if f is not self.function and name in f.writes), None)
        if writer:
            return f"{writer.name}() writes `{name}`; write a variable of its own here"
        return ""

    def element(self, name: str) -> str:
        """How an element of a written argument is written."""
        if name not in {*self.declaration.variables, *self.function.writes}:
            return "y[0]"
        axes = len(variable_of(self.declaration, name).shape)
        return f"{name}[{', '.join('qkj'[:axes]) or 0}]"


def _base_of(node: Any) -> str:
    """The name whose elements a node writes to; "" for anything else than `name[…]…`."""
    while isinstance(node, ast.Subscript | ast.Attribute):
        node = node.value
    return node.id if isinstance(node, ast.Name) else ""


def _is_data(value: Any) -> bool:
    """Whether a value of a module is one to compute with."""
    return value is not None and not callable(value) and not isinstance(value, ModuleType)


def _is_work_space(variable: Variable | None) -> bool:
    """A Local of which a call may use a part; one number is recorded as it is, and has to be this call's."""
    return isinstance(variable, Local) and variable.shape != ()


def called(function: Function) -> str:
    """A function's name as it is said to its author: `Lag.outputs()`."""
    name = getattr(function.python, "__qualname__", function.name).rpartition("<locals>.")[2]
    return f"{name}()"


def _from_bytecode(function: Function) -> Iterator[DeclarationError]:
    """Without its source: rebound arguments and returned values."""
    code = getattr(function.python, "__code__", None)
    if code is None:
        return
    before: Any = None
    line = code.co_firstlineno
    for instruction in dis.get_instructions(code):
        place = instruction.positions
        line = (place.lineno if place else None) or line
        column = ((place.col_offset if place else None) or 0) + 1
        said = None
        if instruction.opname in ("STORE_FAST", "DELETE_FAST") and instruction.argval in function.arguments:
            name = instruction.argval
            said = f"gives the name `{name}` to another value", f"write into it: {name}[0] = …"
        elif _returns_value(instruction, before):
            said = "returns a value, which goes nowhere", "write it in place"
        if said:
            where = Position(shown(code.co_filename), line, column)
            yield DeclarationError(f"{called(function)} {said[0]}", where, said[1])
        before = instruction


def _returns_value(instruction: dis.Instruction, before: Any) -> bool:
    """Whether an instruction, coming after another one, returns anything but None."""
    if instruction.opname == "RETURN_CONST":
        return instruction.argval is not None
    none = before is not None and before.opname == "LOAD_CONST" and before.argval is None
    return instruction.opname == "RETURN_VALUE" and not none
