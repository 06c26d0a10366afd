"""FMI 3's binary data in a diagram: hexadecimal digits, as a model description has them."""

from __future__ import annotations

from collections.abc import Mapping

from cosim.errors import WrongType, WrongValue
from cosim.fmu.ports import Port
from cosim.language.entry import BlockEntry
from cosim.language.source import Node, describe


def check(entry: BlockEntry, ports: Mapping[str, Port]) -> None:
    """See that an entry gives binary parameters what can be read. Raises: WrongType, WrongValue."""
    for name, node in entry.parameters.items():
        if name in ports and ports[name].is_binary:
            _check(entry, ports[name], name, node)


def _check(entry: BlockEntry, port: Port, name: str, node: Node) -> None:
    if isinstance(node.value, list):
        for child in node.value:
            _check(entry, port, name, child)
        return
    if not isinstance(node.value, str):
        message = f"block {entry.name}: `{name}` is binary data, not {describe(node)}"
        raise WrongType(message, node.position, 'write hexadecimal digits between quotation marks, such as "00ff"')
    try:
        port.encoded(node.value)
    except ValueError:
        message = f"block {entry.name}: `{name}` is binary data, and `{node.value[:60]}` no hexadecimal digits"
        raise WrongValue(message, node.position, 'write two digits for each byte, such as "00ff"') from None
