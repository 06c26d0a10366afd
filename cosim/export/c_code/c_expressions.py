"""What LLVM's instructions compute, as C expressions."""

from __future__ import annotations

from cosim.export.c_code.c_values import ValueReader, access, c_type, narrowed, signed
from cosim.export.c_code.llvm_reader import FLAGS, LlvmType, Tokens, Untranslatable

_BINARY = {"add": "+", "sub": "-", "mul": "*", "and": "&", "or": "|", "xor": "^", "shl": "<<", "lshr": ">>"}
_DIVIDING = {"udiv": "/", "urem": "%", "sdiv": "/", "srem": "%"}
_REAL = {"fadd": "+", "fsub": "-", "fmul": "*", "fdiv": "/"}
_ORDER = {"eq": "==", "ne": "!=", "gt": ">", "ge": ">=", "lt": "<", "le": "<="}
_CAST = "trunc zext sext fptrunc fpext fptosi fptoui sitofp uitofp bitcast ptrtoint inttoptr"
_CASTS = frozenset(_CAST.split())
BIT = LlvmType("int", 1)


def computed(reader: ValueReader, operation: str, tokens: Tokens) -> tuple[LlvmType, str]:
    """The type and the expression of what an instruction computes. Raises: Untranslatable."""
    if operation == "getelementptr":
        return LlvmType("ptr"), reader.place(tokens)
    if operation == "load":
        return _loaded(reader, tokens)
    if operation in ("icmp", "fcmp"):
        return BIT, _compared(reader, operation, tokens)
    if operation == "select":
        _, condition = reader.typed(tokens)
        tokens.expect(",")
        kind, first = reader.typed(tokens)
        tokens.expect(",")
        return kind, f"{condition} ? {first} : {reader.typed(tokens)[1]}"
    kind, first = reader.typed(tokens)
    if operation in _CASTS:
        tokens.expect("to")
        to = tokens.type()
        return to, _cast(operation, kind, first, to)
    if operation in ("freeze", "fneg"):
        return kind, first if operation == "freeze" else f"-{first}"
    tokens.expect(",")
    second = reader.value(tokens, kind)
    if operation in _REAL and kind.kind in ("double", "float"):
        return kind, f"{first} {_REAL[operation]} {second}"
    if operation == "frem" and kind.kind == "double":
        return kind, f"m_fmod({first}, {second})"
    return kind, _integer(operation, kind, first, second)


def _loaded(reader: ValueReader, tokens: Tokens) -> tuple[LlvmType, str]:
    """What stands at an address; what another thread may write is read as it stands there then."""
    shared = tokens.accept("atomic") or "volatile" in tokens.items
    tokens.skip(FLAGS)
    kind = tokens.type()
    tokens.expect(",")
    _, place = reader.typed(tokens)
    return kind, f"*(volatile {c_type(kind)} *){place}" if shared else f"load_{access(kind)}({place})"


def _compared(reader: ValueReader, operation: str, tokens: Tokens) -> str:
    predicate = tokens.next()
    tokens.skip(FLAGS)
    kind, first = reader.typed(tokens)
    tokens.expect(",")
    second = reader.value(tokens, kind)
    if operation == "fcmp":
        return _real_comparison(predicate, first, second)
    if kind.kind == "ptr":
        first, second = f"(uintptr_t){first}", f"(uintptr_t){second}"
    elif predicate[0] == "s":
        first, second = signed(first, kind), signed(second, kind)
    return f"{first} {_ORDER[predicate if predicate in _ORDER else predicate[1:]]} {second}"


def _real_comparison(predicate: str, first: str, second: str) -> str:
    """Ordered comparisons are false of a NaN, as C's are, unordered ones true."""
    same, apart = f"{first} == {first} && {second} == {second}", f"{first} < {second} || {first} > {second}"
    special = {
        **{"ord": same, "uno": f"!({same})", "one": apart, "ueq": f"!({apart})", "une": f"{first} != {second}"},
        **{"true": "1u", "false": "0u"},
    }
    if predicate in special:
        return special[predicate]
    if predicate[0] == "o":
        return f"{first} {_ORDER[predicate[1:]]} {second}"
    opposite = {"gt": "<=", "ge": "<", "lt": ">=", "le": ">"}[predicate[1:]]
    return f"!({first} {opposite} {second})"


def _cast(operation: str, kind: LlvmType, value: str, to: LlvmType) -> str:
    """A value as one of another type. Raises: Untranslatable."""
    if operation == "trunc":
        return narrowed(value, to)
    if operation == "sext":
        return narrowed(signed(value, kind), to)
    if operation == "sitofp":
        return f"({c_type(to)}){signed(value, kind)}"
    if operation == "fptosi":
        return narrowed(f"(int{to.container}_t){value}", to)
    if operation == "bitcast" and {kind.kind, to.kind} <= {"int", "double", "float"} and kind.size == to.size:
        return f"bits_of_{kind.kind}({value})" if to.kind == "int" else f"{to.kind}_of_bits({value})"
    if operation in ("ptrtoint", "inttoptr"):
        return f"({c_type(to)})(uintptr_t){value}"
    if operation in ("zext", "uitofp", "fptoui", "fptrunc", "fpext"):
        return f"({c_type(to)}){value}"
    raise Untranslatable(f"it has a {operation} of an LLVM {kind.kind}")


def _integer(operation: str, kind: LlvmType, first: str, second: str) -> str:
    """An operation on integers, in a type of 32 bits or more, as C would widen smaller ones with a sign."""
    if kind.kind != "int":
        raise Untranslatable(f"it has `{operation}` of an LLVM {kind.kind}")
    wide = f"(uint{max(kind.container, 32)}_t)"
    if operation in _BINARY:
        return narrowed(f"{wide}{first} {_BINARY[operation]} {wide}{second}", kind)
    if operation == "ashr":
        return narrowed(f"{signed(first, kind)} >> {second}", kind)
    if operation in _DIVIDING:
        values = [signed(v, kind) if operation[0] == "s" else wide + v for v in (first, second)]
        return narrowed(f"{values[0]} {_DIVIDING[operation]} {values[1]}", kind)
    raise Untranslatable(f"it has the operation `{operation}`")
