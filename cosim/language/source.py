"""YAML with the place of every key and value: text -> events of the YAML parser -> a tree of nodes; and back to text.

Scalars follow the core schema of YAML 1.2: `1e-3` is a number, `on` and `yes` are text, keys are always text.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, ClassVar

import yaml
from yaml.events import AliasEvent, CollectionStartEvent, Event, MappingStartEvent, ScalarEvent, SequenceStartEvent

from cosim.errors import (
    CosimError,
    DuplicateKey,
    MissingFile,
    Position,
    Problems,
    TooLarge,
    WrongType,
    WrongValue,
    YamlSyntaxError,
    nearest,
)
from cosim.language import unsaved

_LOADER = getattr(yaml, "CBaseLoader", yaml.BaseLoader)
_DUMPER = getattr(yaml, "CSafeDumper", yaml.SafeDumper)
MOST_FILE_BYTES = 1 << 24
"""Of YAML or Python. YAML takes up to 150 times as much memory, and some ten seconds for each MiB."""
_DEEPEST = 50
_MOST_ALIASED = 100_000
_TAG = "tag:yaml.org,2002:"
_LITERALS: dict[str, bool | None] = {
    **dict.fromkeys(("", "~", "null", "Null", "NULL")),
    **dict.fromkeys(("true", "True", "TRUE"), True),
    **dict.fromkeys(("false", "False", "FALSE"), False),
}
_INTEGER = re.compile(r"[-+]?[0-9]+|0o[0-7]+|0x[0-9a-fA-F]+")
_FLOAT = re.compile(r"[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]+)?|[-+]?\.(inf|Inf|INF)|\.(nan|NaN|NAN)")


@dataclass(slots=True)
class Node:
    """A value with its place. Never changed once made: aliases share nodes.

    value: str, int, float, bool, None, list[Node] or dict[str, Node], or what has been read for it, which has a `plain`
    form too. inherited: written for a block type that a
    later layer has replaced, so that it counts only where the new type declares it. replaces: for a block's type, the
    one that it replaces, as kind and name. blank: a key without a value, where `~` would say that there is to be none.
    beside: of a wire, what it says besides the source. made: of a block's type, the class itself, where a program gives
    it; the value is its name.
    """

    value: Any
    position: Position
    key_position: Position | None = None
    inherited: bool = False
    replaces: tuple[str, Node] | None = None
    blank: bool = False
    beside: Mapping[str, Node] = field(default_factory=dict)
    made: type | None = None

    @property
    def place(self) -> Position:
        """Where the key stands, or the value if there is no key."""
        return self.key_position or self.position

    def plain(self) -> Any:
        """The value alone, without places."""
        if self.beside:
            source = replace(self, beside={})
            return {"from": source.plain(), **{key: node.plain() for key, node in self.beside.items()}}
        if isinstance(self.value, dict):
            return {key: node.plain() for key, node in self.value.items()}
        if isinstance(self.value, list):
            return [node.plain() for node in self.value]
        return self.value.plain() if hasattr(self.value, "plain") else self.value


def read(path: str | Path, problems: Problems, named_at: Position | None = None) -> Node:
    """The mapping that a YAML file is. Duplicate keys go to `problems`; what cannot be read at all is raised.

    Raises: MissingFile (at `named_at`, where the file is named), YamlSyntaxError, WrongType.
    """
    file, text = str(path), unsaved.text(path)
    if text is None:
        text = _decoded(read_bytes(path, named_at), file)
    tree = _Composer(text, file, problems).document()
    if tree is None or tree.value is None:
        raise WrongType("the file is empty", Position(file, 1, 1), "write lines of `key: value`")
    if not isinstance(tree.value, dict):
        message = f"the file must be a mapping, not {describe(tree)}"
        raise WrongType(message, tree.position, "write lines of `key: value`")
    return tree


def _decoded(data: bytes, file: str) -> str:
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        before = data[: error.start]
        place = Position(file, before.count(b"\n") + 1, error.start - before.rfind(b"\n"))
        raise YamlSyntaxError("the file is not UTF-8 text", place, "save it with the encoding UTF-8") from None


def parse_value(text: str, position: Position) -> Node:
    """The YAML value that a piece of the command line is, each node of it at the same place.

    Raises: YamlSyntaxError, DuplicateKey (in a DiagramErrors).
    """
    problems = Problems()
    tree = _Composer(text, position.file, problems, position).document()
    problems.raise_if_any()
    return tree or Node(None, position)


def read_bytes(path: str | Path, named_at: Position | None = None) -> bytes:
    """The content of a file that a person names.

    Raises: MissingFile, whose fix is the nearest name in the same folder; TooLarge.
    """
    path = Path(path)
    place = named_at or Position(str(path))
    try:
        if path.is_file():
            with path.open("rb") as file:
                content = file.read(MOST_FILE_BYTES + 1)
            if len(content) > MOST_FILE_BYTES:
                raise TooLarge(f"`{path}` has more than {MOST_FILE_BYTES >> 20} MiB", place, "name a smaller file")
            return content
        if path.is_dir():
            raise MissingFile(f"`{path}` is a folder, not a file", place, "name a file in it")
        if path.exists():
            raise MissingFile(f"`{path}` is a pipe or a device, not a file", place, "name a file")
        siblings = [p.name for p in path.parent.iterdir() if p.suffix == path.suffix] if path.parent.is_dir() else []
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        raise MissingFile(f"`{path}` cannot be read: {reason}", place, "check its name and permissions") from None
    folder = "" if path.parent.is_dir() else f"; there is no folder `{path.parent}`"
    fix = nearest(path.name, siblings) or "check the name and the folder"
    raise MissingFile(f"there is no file `{path}`{folder}", place, fix)


def describe(node: Node) -> str:
    """What a value is, in words: for messages."""
    value = node.value
    if isinstance(value, dict):
        return "a mapping"
    if isinstance(value, list):
        return f"a list of {len(value)}"
    if isinstance(value, str):
        return f"the text `{value if len(value) < 60 else value[:57] + '…'}`"
    return "nothing" if value is None else f"`{str(value).lower() if isinstance(value, bool) else value}`"


def title_of(path: Path) -> str:
    """What a file is called as long as it says no title: its name as a text, though names of files may be any bytes."""
    return path.stem.encode(errors="backslashreplace").decode()


def dump(value: Any) -> str:
    """YAML text that reads back as the same plain value."""
    return yaml.dump(value, Dumper=_CoreDumper, sort_keys=False, default_flow_style=None, width=110, allow_unicode=True)


class _Composer:
    """Turns the parser's events into nodes; bounds nesting and what aliases expand to."""

    def __init__(self, text: str, file: str, problems: Problems, fixed: Position | None = None) -> None:
        self.text = text
        self.file = file
        self.problems = problems
        self.fixed = fixed
        self.anchors: dict[str, Node | None] = {}
        self.aliased = 0
        self.events: Iterator[Event] = iter(())

    def document(self) -> Node | None:
        """The text's one document; None if it is empty.

        Raises: YamlSyntaxError.
        """
        try:
            self.events = yaml.parse(self.text, Loader=_LOADER)
            next(self.events)
            start = next(self.events)
            if not isinstance(start, yaml.DocumentStartEvent):
                return None
            tree = self.node(next(self.events), 0)
            next(self.events)
            more = next(self.events)
        except yaml.YAMLError as error:
            raise self.syntax_error(error) from None
        except UnicodeError:
            raise YamlSyntaxError("the text is not Unicode", self.fixed or Position(self.file)) from None
        if isinstance(more, yaml.DocumentStartEvent):
            raise YamlSyntaxError("a second document begins here", self.place(more), "remove the line `---`")
        return tree

    def place(self, event: Event) -> Position:
        mark = event.start_mark
        assert mark is not None
        return self.fixed or Position(self.file, mark.line + 1, mark.column + 1)

    def node(self, event: Event, depth: int) -> Node:
        place = self.place(event)
        if isinstance(event, AliasEvent):
            return self.alias(event, depth)
        if depth > _DEEPEST:
            raise YamlSyntaxError(f"values are nested more than {_DEEPEST} levels deep", place, "use fewer levels")
        assert isinstance(event, (ScalarEvent, CollectionStartEvent))
        if event.anchor:
            self.anchors[event.anchor] = None
        if isinstance(event, ScalarEvent):
            blank = event.value == "" and event.implicit[0] and event.tag is None
            node = Node(self.scalar(event), place, blank=blank)
        elif event.tag not in (None, "!"):
            raise self.unknown_tag(event)
        elif isinstance(event, SequenceStartEvent):
            items = []
            while not isinstance(item := next(self.events), yaml.SequenceEndEvent):
                items.append(self.node(item, depth + 1))
            node = Node(items, place)
        else:
            assert isinstance(event, MappingStartEvent)
            node = Node(self.mapping(depth), place)
        if event.anchor:
            self.anchors[event.anchor] = node
        return node

    def mapping(self, depth: int) -> dict[str, Node]:
        """The entries up to the mapping's end; `<<` fills in what the mapping itself does not say."""
        entries: dict[str, Node] = {}
        merged: list[Node] = []
        while not isinstance(key := next(self.events), yaml.MappingEndEvent):
            place = self.place(key)
            if not isinstance(key, ScalarEvent):
                raise YamlSyntaxError("a key must be plain text", place, "write `key: value`")
            value = self.node(next(self.events), depth + 1)
            if key.value == "<<" and key.implicit[0]:
                merged += value.value if isinstance(value.value, list) else [value]
            elif key.value in entries:
                message = f"the key `{key.value}` is here a second time, first at {entries[key.value].key_position}"
                self.problems.add(DuplicateKey(message, place, "remove one of the two"))
            else:
                entries[key.value] = replace(value, key_position=place)
        for other in merged:
            if not isinstance(other.value, dict):
                message = f"`<<` takes mappings, not {describe(other)}"
                raise YamlSyntaxError(message, other.position, "give it an alias of a mapping, `<<: *name`")
            for name, value in other.value.items():
                entries.setdefault(name, value)
        return entries

    def alias(self, event: AliasEvent, depth: int) -> Node:
        name = str(event.anchor)
        if name not in self.anchors:
            known = nearest(name, self.anchors) or f"mark a value with `&{name}` first"
            raise YamlSyntaxError(f"the alias `*{name}` has no anchor before it", self.place(event), known)
        node = self.anchors[name]
        if node is None:
            raise YamlSyntaxError(f"the alias `*{name}` contains itself", self.place(event), "write the value out")
        size, height = _extent(node)
        self.aliased += size
        if self.aliased > _MOST_ALIASED or depth + height > _DEEPEST:
            message = f"aliases expand to more than {_MOST_ALIASED} values or {_DEEPEST} levels"
            raise YamlSyntaxError(message, self.place(event), "use fewer aliases of aliases")
        return node

    def scalar(self, event: ScalarEvent) -> Any:
        text = event.value
        if event.tag not in (None, "!", _TAG + "str"):
            raise self.unknown_tag(event)
        if event.tag or not event.implicit[0]:
            if "\0" in text:
                message = "the text contains the invisible character NUL"
                self.problems.add(WrongValue(message, self.place(event), "remove `\\0`"))
            return text.replace("\0", "")
        if text in _LITERALS:
            return _LITERALS[text]
        if _INTEGER.fullmatch(text):
            value = _whole(text)
        elif _FLOAT.fullmatch(text):
            value = _real(text)
        else:
            return text
        if (not value or math.isinf(value)) and not _holds(text, value):
            shown = text if len(text) < 30 else f"{text[:27]}…"
            message = f"the number `{shown}` is beyond the range of floating-point numbers"
            self.problems.add(WrongValue(message, self.place(event), "from 2.3e-308 to 1.7e308, or 0, or `.inf`"))
        return value

    def unknown_tag(self, event: ScalarEvent | CollectionStartEvent) -> CosimError:
        message = f"tags such as `{event.tag}` are not allowed"
        return YamlSyntaxError(message, self.place(event), "remove the tag")

    def syntax_error(self, error: yaml.YAMLError) -> CosimError:
        mark = getattr(error, "problem_mark", None)
        index = getattr(error, "position", None)
        if mark is not None:
            place = Position(self.file, mark.line + 1, mark.column + 1)
        elif isinstance(index, int):
            before = self.text[:index]
            place = Position(self.file, before.count("\n") + 1, index - before.rfind("\n"))
        else:
            place = Position(self.file)
        message = getattr(error, "problem", None) or getattr(error, "reason", None) or str(error)
        context, begin = getattr(error, "context", None), getattr(error, "context_mark", None)
        if context and begin is not None:
            message += f" {context} that begins at line {begin.line + 1}"
        return YamlSyntaxError(f"broken YAML: {message}", self.fixed or place, self.advice(place, message))

    def advice(self, place: Position, message: str) -> str:
        line = self.text.split("\n")[place.line - 1] if 0 < place.line <= self.text.count("\n") + 1 else ""
        if "\t" in line[: place.column]:
            return "indent with spaces, not tabs"
        if "mapping values" in message:
            return "indent the line like its neighbours, and quote text that contains `: `"
        if "flow " in message and (wire := re.search(r"[\w/]+\.\w+\[[\d.]+\]", line)):
            return f'quote a wire that takes members: "{wire[0]}"'
        if "flow " in message:
            return "close the bracket, and put a comma between two values"
        if "quoted scalar" in message:
            return "close the quotation mark"
        if "control characters" in message or "special characters" in message:
            return "remove the invisible character"
        if "start any token" in message:
            return f"quote text that begins with `{line[place.column - 1 : place.column]}`"
        return "check the indentation and the brackets of this line and the one before"


def _whole(text: str) -> int | float:
    """An integer; one that no integer of 64 bits holds, with a sign or without, as a float."""
    base = {"0o": 8, "0x": 16}.get(text[:2], 10)
    if base == 10 and len(text) > 25:
        return float(text)
    value = int(text, base)
    if value.bit_length() > 1023:
        return math.inf
    return value if -(1 << 63) < value < 1 << 64 else float(value)


def _holds(text: str, value: float) -> bool:
    """Whether a zero or an infinity is the number as written, not one too small or too large for a float."""
    if math.isinf(value):
        return "." in text and text[-1] in "fF"
    return not re.search("[1-9]", re.split("[eE]", text)[0]) or text.startswith("0x")


def _real(text: str) -> float:
    return float(text.replace(".", "", 1) if text[-1] in "fFnN" else text)


def _extent(node: Node) -> tuple[int, int]:
    """How many values a node is, and how many levels."""
    below = node.value.values() if isinstance(node.value, dict) else node.value if isinstance(node.value, list) else ()
    extents = [_extent(child) for child in below]
    return 1 + sum(size for size, _ in extents), 1 + max((height for _, height in extents), default=-1)


class _CoreDumper(_DUMPER):  # type: ignore[misc, valid-type]  # yaml has one or the other
    """Quotes the text that the core schema would read as something else."""

    yaml_implicit_resolvers: ClassVar[dict[str, Any]] = {}

    def ignore_aliases(self, data: Any) -> bool:
        return True


_CoreDumper.add_implicit_resolver(_TAG + "null", re.compile(r"(?:~|null|Null|NULL|)$"), None)
_CoreDumper.add_implicit_resolver(_TAG + "bool", re.compile(r"(?:true|True|TRUE|false|False|FALSE)$"), None)
_CoreDumper.add_implicit_resolver(_TAG + "int", re.compile(f"(?:{_INTEGER.pattern})$"), None)
_CoreDumper.add_implicit_resolver(_TAG + "float", re.compile(f"(?:{_FLOAT.pattern})$"), None)
_CoreDumper.add_implicit_resolver(_TAG + "merge", re.compile(r"<<$"), None)
