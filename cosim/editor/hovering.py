"""What a word means, as a page in Markdown."""

from __future__ import annotations

from cosim.editor import meanings, meant
from cosim.editor.cursor import Cursor
from cosim.editor.reading import Reading


def page(cursor: Cursor, reading: Reading) -> str:
    """About the word under the cursor; "" where there is nothing to say."""
    if not cursor.word:
        return ""
    target = meant.find(cursor, reading)
    if target.declaration and target.variable:
        return meanings.of_variable(target.declaration, target.variable, target.block, reading)
    if target.declaration:
        return meanings.of_block(target.block, target.declaration, reading)
    if target.block in reading.inner:
        return meanings.of_diagram(target.block, reading.inner[target.block])
    if target.key:
        return meanings.of_key(cursor.word if cursor.is_key else cursor.path[-1], target.key)
    return ""
