"""From an `expression:` of a diagram to a block type: its names are inputs, parameters and outputs of the block."""

from __future__ import annotations

import keyword
import unicodedata
from collections.abc import Mapping
from dataclasses import dataclass, field
from graphlib import CycleError, TopologicalSorter

from cosim.authoring.block import Block
from cosim.authoring.expression_code import OutputCode, output_code
from cosim.errors import ExpressionError, Problems, UnknownParameter, WrongValue, nearest
from cosim.language import expression_tree
from cosim.language.elementary import FUNCTIONS
from cosim.language.entry import SINGLE, BlockEntry, outputs_of
from cosim.language.expression import CONSTANTS, OF_A_FLEET
from cosim.language.expression_tree import Expression, Name, is_truth, named
from cosim.language.places import within
from cosim.language.source import Node
from cosim.wiring.expression_type import block_type, function_name


def block(entry: BlockEntry) -> type[Block]:
    """The block type that a diagram's entry of kind `expression` says.

    What was written for another type and is not used is left out. Raises: ExpressionError, WrongValue,
    UnknownParameter; DiagramErrors with several of them.
    """
    draft = _Draft(entry)
    draft.read()
    draft.problems.raise_one_or_all()
    return draft.made()


@dataclass
class _Draft:
    """What an entry says.

    written: by output, the text and where it stands; readable: those that can be read; inputs, parameters: where each
    is given.
    """

    entry: BlockEntry
    problems: Problems = field(default_factory=Problems)
    written: dict[str, Node] = field(default_factory=dict)
    readable: dict[str, Expression] = field(default_factory=dict)
    inputs: dict[str, Node] = field(default_factory=dict)
    parameters: dict[str, Node] = field(default_factory=dict)

    def read(self) -> None:
        """Read the expressions, and see that their names are those of the block."""
        entry = self.entry
        self.written = outputs_of(entry.type)
        for output, text in self.written.items():
            if said := flaw(output):
                self._wrong(f"an output cannot be called `{output}`: {said[0]}", text, said[1])
            elif read := self.problems.attempt(self._formula, text):
                self.readable[output] = read
        starts = {n: v for n, v in entry.start.items() if n not in self.written and n not in entry.parameters}
        self.inputs, self.parameters = {**starts, **entry.inputs}, {**entry.parameters}
        for name, dimension in entry.dimensions.items():
            message = f"block {entry.name}: an expression has no dimension `{name}`"
            if not dimension.inherited:
                fix = "remove it: sizes are those of what is wired and given"
                self.problems.add(UnknownParameter(message, dimension.place, fix))
        self._check_given()
        self._check_names()

    def made(self) -> type[Block]:
        """The block type. Raises: ExpressionError, DiagramErrors with several."""
        truths = {n.name: n.truth for read in self.readable.values() for n in named(read)}
        inputs, parameters = ({n: truths[n] for n in part} for part in (self.inputs, self.parameters))
        known = {
            **inputs,
            **parameters,
            **{output: is_truth(read) for output, read in self.readable.items()},
        }
        names, codes = [*self.written], list[OutputCode]()
        for output in self._order():
            code = self.problems.attempt(self._code, output, function_name(output, names), known)
            codes += [code] if code else []
        self.problems.raise_one_or_all()
        texts = [f"{code.name} = {' '.join(str(self.written[code.name].value).split())}" for code in codes]
        return block_type(codes, texts, inputs, parameters)

    def _formula(self, node: Node) -> Expression:
        try:
            return expression_tree.read(str(node.value))
        except ExpressionError as error:
            raise self._placed(error, node) from None

    def _code(self, output: str, function: str, known: Mapping[str, bool]) -> OutputCode:
        try:
            return output_code(output, self.readable[output], function, known)
        except ExpressionError as error:
            raise self._placed(error, self.written[output]) from None

    def _placed(self, error: ExpressionError, node: Node) -> ExpressionError:
        return ExpressionError(f"block {self.entry.name}: {error.message}", within(node, error.offset), error.fix)

    # ---- names ----

    def _check_given(self) -> None:
        """See that what is given has names of its own, and is used."""
        used = {n.name for read in self.readable.values() for n in named(read)}
        whole = len(self.readable) == len(self.written)
        for article, section, given in (("an", "input", self.inputs), ("a", "parameter", self.parameters)):
            for name, node in list(given.items()):
                if name not in used and node.inherited:
                    del given[name]
                elif said := flaw(name):
                    self._wrong(f"no expression can name the {section} `{name}`: {said[0]}", node, said[1])
                elif name in self.written:
                    self._wrong(f"`{name}` is an output and {article} {section} too", node, self._other_name(name))
                elif section == "parameter" and name in self.inputs:
                    self._wrong(f"`{name}` is an input and a parameter too", node, "give one of them another name")
                elif name not in used and whole:
                    fix = "use it, or remove it"
                    self._wrong(f"the {section} `{name}` is in no expression of the block", node, fix)

    def _other_name(self, name: str) -> str:
        if name == SINGLE and not isinstance(self.entry.type.value, dict):
            return f'name the output, which is `{SINGLE}` else: expression: {{u: "…"}}'
        return "give one of them another name"

    def _check_names(self) -> None:
        """See that each name in the expressions stands for one thing."""
        given = {*self.inputs, *self.parameters}
        kinds: dict[str, bool] = {name: False for name in ("time", *CONSTANTS) if name not in given}
        kinds |= {output: is_truth(read) for output, read in self.readable.items()}
        known = {*given, *kinds, *self.written}
        for output, read in self.readable.items():
            told: set[str] = set()
            for name in named(read):
                if name.name in told:
                    continue
                if name.name not in known:
                    told.add(name.name)
                    self._say(name, output, *self._unknown(name.name))
                elif kinds.setdefault(name.name, name.truth) != name.truth:
                    told.add(name.name)
                    self._say(name, output, *self._mixed(name))
        if not self.problems.errors:  # else a name may be another's
            self._check_circle()

    def _unknown(self, name: str) -> tuple[str, str]:
        """What is said of a name that the block does not have."""
        if name in FUNCTIONS:
            return f"the function `{name}` has no argument", f"write {name}(…)"
        if name in OF_A_FLEET:
            fix = f'give it as a parameter, parameters: {{{name}: "{name}"}}, where it stands for that'
            return f"`{name}`, {OF_A_FLEET[name]}, is known where values are given only", fix
        own = f"add `{name}:` under blocks.{self.entry.name}.inputs or .parameters"
        close = nearest(name, {*self.inputs, *self.parameters, "time"})
        return f"`{name}` is neither an input nor a parameter", f"{close} Else {own}" if "did you" in close else own

    def _mixed(self, name: Name) -> tuple[str, str]:
        if name.name not in {*self.inputs, *self.parameters}:
            what = "a number" if name.truth else "a truth value"
            fix = "compare it with another, such as `> 0`" if name.truth else f"write if({name.name}, 1, 0)"
            return f"`{name.name}` is {what}, and stands where there is none", fix
        here, there = ("a truth value", "a number") if name.truth else ("a number", "a truth value")
        return f"`{name.name}` is {here} here and {there} elsewhere", "compare the number, such as `> 0`"

    def _check_circle(self) -> None:
        try:
            self._order()
        except CycleError as error:
            circle = error.args[1][::-1]
            first = min(circle, key=[*self.readable].index)
            read = next(n for n in named(self.readable[first]) if n.name in circle)
            alone = f"`{first}` is what the expression computes" if len(set(circle)) == 1 else ""
            what = alone or f"the outputs {', '.join(f'`{n}`' for n in dict.fromkeys(circle))} read each other"
            fix = f"wire it to an input of another name, such as inputs: {{x: {self.entry.name}.{read.name}}}"
            self._say(read, first, what, fix)

    def _order(self) -> list[str]:
        """The outputs, each after those that it reads. Raises: CycleError."""
        reads = {o: [n.name for n in named(f) if n.name in self.readable] for o, f in self.readable.items()}
        return [*TopologicalSorter(reads).static_order()]

    def _say(self, name: Name, output: str, what: str, fix: str) -> None:
        place = within(self.written[output], name.offset)
        self.problems.add(ExpressionError(f"block {self.entry.name}: {what}", place, fix))

    def _wrong(self, what: str, node: Node, fix: str) -> None:
        self.problems.add(WrongValue(f"block {self.entry.name}: {what}", node.place, fix))


def flaw(name: str) -> tuple[str, str] | None:
    """Why a name cannot stand in an expression, and what to write instead; None if it can."""
    plain = unicodedata.normalize("NFKC", name)
    if name == "time":
        return "it is the simulated time", "call it otherwise, such as `t`"
    if keyword.iskeyword(name) or (name.startswith("__") and name.endswith("__")):
        return "it has a meaning of its own", f"call it otherwise, such as `{name.strip('_')}_`"
    if not plain.isidentifier():
        return "a name is of letters, digits and _, and begins with no digit", f"call it otherwise, {_like(plain)}"
    return None if plain == name else ("letters are read in their plain form", f"write `{plain}`")


def _like(name: str) -> str:
    """A name that is like one which cannot be."""
    word = "".join(letter if letter.isalnum() else "_" for letter in name).strip("_")
    return f"such as `{word if word[:1].isalpha() else f'u_{word}'}`"
