"""An author's function, with arithmetic of whole arrays, as one of loops, which both engines run to the same bits.

It takes the memory that it needs as further arguments, and so does each helper that is lowered for it. A function in
which there is nothing to lower stays as it is.
"""

from __future__ import annotations

import ast
import types
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, cast

from cosim.authoring.author_source import Text, arguments_of, function_text
from cosim.authoring.lowering import syntax
from cosim.authoring.lowering.array_expressions import ArrayExpressions
from cosim.authoring.lowering.array_statements import ArrayStatements
from cosim.authoring.lowering.lowered_values import Array, Scalar, Several, Value, has_arrays, stored
from cosim.authoring.lowering.names import Names, kind_of_constant
from cosim.authoring.lowering.returning import Returning, numbers_in
from cosim.authoring.lowering.work import Into, LoweredFunction, Refusal, Work
from cosim.authoring.scope import scope_of

#: The text of each function that has been made, by its code.
TREES: dict[types.CodeType, ast.Module] = {}


@dataclass
class Session:
    """The lowering of a function and of all helpers that it calls.

    refusals: what is wrong, with the text where it stands; handled: of all nodes those that are lowered, by id; seen:
    the names that were looked up outside, by the scope, with what they were; texts: each function with its node.
    """

    dimensions: frozenset[str]
    refusals: list[tuple[Text, Refusal]] = field(default_factory=list)
    handled: set[int] = field(default_factory=set)
    seen: list[tuple[dict[str, Any], dict[str, Any]]] = field(default_factory=list)
    texts: list[tuple[Any, Any]] = field(default_factory=list)
    _known: dict[Any, LoweredFunction | None] = field(default_factory=dict)

    def is_current(self) -> bool:
        """Whether all names stand for what they stood for."""
        same = all(scope.get(name) is value for scope, names in self.seen for name, value in names.items())
        return same and all((text := function_text(f)) and text.node is node for f, node in self.texts)

    def function(self, python: Any, arguments: Mapping[str, Value], is_helper: bool) -> LoweredFunction | None:
        """A function for arguments of some kinds; None while it is being lowered, or where it cannot be read."""
        key = (python, tuple((name, _key(value)) for name, value in arguments.items()))
        if key not in self._known:
            self._known[key] = None
            text = function_text(python)
            if text is not None:
                self._known[key] = self._lowered(python, text, arguments, is_helper)
        return self._known[key]

    def _lowered(self, python: Any, text: Text, arguments: Mapping[str, Value], is_helper: bool) -> LoweredFunction:
        scope = scope_of(cast("types.FunctionType", python))
        names = {n for n in python.__code__.co_names if n in python.__globals__}
        self.texts.append((python, text.node))
        self.seen.append((python.__globals__, {n: python.__globals__[n] for n in names}))
        used = {n.id for n in ast.walk(text.node) if isinstance(n, ast.Name)} | {*arguments, *python.__globals__}
        work = Work(used, self.dimensions, scope)
        if is_helper:
            work.sharing = frozenset(name for name, value in arguments.items() if isinstance(value, Array))
        known = Names(text.node, arguments, scope, is_helper)
        returning = Returning() if is_helper else None
        expressions = ArrayExpressions(work, known, self._call)
        statements = ArrayStatements(work, known, expressions, returning)
        body = statements.walk(text.node.body)
        statements.finish()
        self.handled |= work.handled
        self.refusals += [(text, refusal) for refusal in work.refusals]
        result, is_view = (returning.result, returning.is_view) if returning else (None, False)
        written = frozenset(work.in_place & {*arguments})
        if work.refusals or not work.changed:
            return LoweredFunction(python, result=result, is_view=is_view, written=written)
        tree = _tree(text, [*arguments, *(t.name for t in work.temporaries)], body)
        made = _made(python, tree, text.file, work.added)
        return LoweredFunction(made, tuple(work.temporaries), True, result, is_view, written)

    # ---- calls of helpers ----

    def _call(
        self,
        expressions: ArrayExpressions,
        node: ast.Call,
        python: types.FunctionType,
        given: dict[str, Value],
        into: Into | None,
    ) -> Value:
        """A call of an author's own function. Raises: Refusal."""
        work = expressions.work
        text = function_text(python)
        if text is None:
            return Scalar(_with_arguments(work, node, python, given))
        arguments = _bound(work, node, python, text, given)
        if arguments is None:
            return Scalar(_with_arguments(work, node, python, given))
        if any(isinstance(v, Several) for v in arguments.values()):
            fix = "give it the arrays one by one"
            work.refuse(node, f"gives a tuple of arrays to {python.__name__}()", fix)
        kinds = {name: _as_argument(name, value) for name, value in arguments.items()}
        before = len(self.refusals)
        lowered = self.function(python, kinds, is_helper=True)
        if len(self.refusals) > before:
            raise Refusal(node, "", "")
        if lowered is None:
            return Scalar(_with_arguments(work, node, python, given))
        lying = {name: _lying(work, value, node) for name, value in arguments.items()}
        if lowered.written and node is not work.whole:
            what = f"calls {python.__name__}(), which writes `{min(lowered.written)}`, within an expression of arrays"
            work.writing.append(Refusal(node, what, "call it in a statement of its own"))
        for name in lowered.written:
            value = lying[name]
            if isinstance(value, Array):
                work.writes(value)
        if not lowered.changed:
            return _unchanged(work, node, python, lowered, given, lying)
        return _changed(work, python, lowered, lying, into, node)


def _key(value: Value) -> Any:
    if isinstance(value, Array):
        return (value.kind, value.root)
    if isinstance(value, Several):
        return tuple(map(_key, value.items))
    return (value.element, value.size)


def _bound(
    work: Work, node: Any, python: types.FunctionType, text: Text, given: dict[str, Value]
) -> dict[str, Value] | None:
    """What each argument of a helper is given, or has by default; None where that cannot be told. Raises: Refusal."""
    names = [a.arg for a in arguments_of(text.node)]
    defaults = dict(zip(names[::-1], (python.__defaults__ or ())[::-1], strict=False))
    found: dict[str, Value] = {}
    for k, name in enumerate(names):
        value = given.get(str(k), given.get(name))
        if value is None and name in defaults:
            default = defaults[name]
            value = kind_of_constant(syntax.name(work.add("_default", default)), default)
        if value is None:
            work.refuse(node, f"calls {python.__name__}() without `{name}`", "give one value for each argument")
        found[name] = value
    if len(given) > len(names) or text.node.args.vararg or text.node.args.kwarg or text.node.args.kwonlyargs:
        if any(map(has_arrays, given.values())):
            fix = f"call it with its arguments {', '.join(names)}"
            work.refuse(node, f"calls {python.__name__}() with other arguments than it has", fix)
        return None
    return found


def _as_argument(name: str, value: Value) -> Value:
    """What an argument stands for inside the helper."""
    if isinstance(value, Array):
        return stored(name, name, value.kind)
    return Scalar(syntax.name(name), getattr(value, "element", ""), getattr(value, "size", None))


def _lying(work: Work, value: Value, node: Any) -> Value:
    if isinstance(value, Array):
        return work.materialised(value, node)
    return value


def _node(value: Value) -> Any:
    return syntax.name(value.storage) if isinstance(value, Array) else getattr(value, "node", None)


def _with_arguments(work: Work, node: ast.Call, python: types.FunctionType, given: dict[str, Value]) -> ast.Call:
    """A call of a helper with its arguments as they are lowered; the call itself where they are the same."""
    nodes = {key: _node(_lying(work, value, node)) for key, value in given.items()}
    own = [(str(k), a) for k, a in enumerate(node.args)] + [(str(k.arg), k.value) for k in node.keywords]
    function = node.func
    if isinstance(function, ast.Attribute):  # of a module, which compiled code cannot follow
        work.changed = True
        function = ast.copy_location(syntax.name(work.add(f"{python.__name__}_", python)), function)
    if function is node.func and all(
        nodes[key] is old or getattr(nodes[key], "id", "") == getattr(old, "id", None) for key, old in own
    ):
        return node
    keywords = [ast.keyword(k.arg, nodes[str(k.arg)]) for k in node.keywords]
    return ast.Call(function, [nodes[str(k)] for k in range(len(node.args))], keywords)


def _unchanged(
    work: Work,
    node: ast.Call,
    python: types.FunctionType,
    lowered: LoweredFunction,
    given: dict[str, Value],
    lying: Mapping[str, Value],
) -> Value:
    called = _with_arguments(work, node, python, given)
    result = lowered.result
    if not isinstance(result, Array):
        return Scalar(called, result.element if isinstance(result, Scalar) else "")
    name = work.fresh("_view")
    work.emit(syntax.assign(name, called))
    return stored(name, _root(lying, result), result.kind)


def _root(given: Mapping[str, Value], view: Array) -> str:
    """To whose memory a view of an argument belongs for the caller."""
    argument = given.get(view.root)
    return argument.root if isinstance(argument, Array) else view.root


def _changed(
    work: Work, python: Any, lowered: LoweredFunction, lying: dict[str, Value], into: Into | None, node: Any
) -> Value:
    work.changed = True
    own: dict[str, Array] = {}
    given = [v for v in lying.values() if isinstance(v, Array)]
    for temporary in lowered.temporaries:
        target = into if isinstance(lowered.result, Array) and lowered.result.storage == temporary.name else None
        own[temporary.name] = work.result(temporary.kind, given, target, node)
    function = work.add(f"{python.__name__}_", lowered.python)
    called = syntax.call(function, *map(_node, lying.values()), *map(_node, own.values()))
    if lowered.is_view and isinstance(lowered.result, Array):
        name = work.fresh("_view")
        work.emit(syntax.assign(name, called))
        return stored(name, _root(lying, lowered.result), lowered.result.kind)
    if lowered.result is None or isinstance(lowered.result, Scalar):
        return Scalar(called, lowered.result.element if lowered.result else "")
    numbers = numbers_in(lowered.result)
    back = work.fresh("_back") if numbers else ""
    work.emit(syntax.assign(back, called) if numbers else ast.Expr(called))
    parts = (
        [syntax.name(back)] if numbers == 1 else [syntax.element(back, [syntax.constant(k)]) for k in range(numbers)]
    )
    return _handed_back(lowered.result, own, iter(parts))


def _handed_back(value: Value, own: Mapping[str, Array], numbers: Any) -> Value:
    if isinstance(value, Several):
        return Several(tuple(_handed_back(v, own, numbers) for v in value.items))
    return Scalar(next(numbers), value.element) if isinstance(value, Scalar) else own[value.storage]


def _tree(text: Text, arguments: list[str], body: list[Any]) -> ast.Module:
    """A module of the lowered function alone."""
    node = text.node
    taken = ast.arguments([], [ast.arg(a) for a in arguments], None, [], [], None, [])
    function = ast.FunctionDef(node.name, taken, body, [], None)
    syntax.located([function], node)
    function.lineno = min([node.lineno, *(d.lineno for d in node.decorator_list)])
    return ast.fix_missing_locations(ast.Module([function], []))


def _made(python: Any, tree: ast.Module, file: str, added: dict[str, Any]) -> types.FunctionType:
    """The function of a tree, which sees what the author's sees."""
    code = next(c for c in compile(tree, file, "exec", dont_inherit=True).co_consts if isinstance(c, types.CodeType))
    TREES[code] = tree
    scope = {**python.__globals__, **added}
    for name, cell in zip(python.__code__.co_freevars, python.__closure__ or (), strict=True):
        scope[name] = cell.cell_contents
    made = types.FunctionType(code, scope, python.__name__)
    made.__module__, made.__qualname__ = python.__module__, python.__qualname__
    return made
