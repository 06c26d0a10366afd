"""What somebody may have meant by a text that is no arithmetic: the words of other languages, and of typography."""

from __future__ import annotations

import keyword
import re

from cosim.errors import ExpressionError

_SHOWN = 60
_WORDS = "|".join(sorted(set(keyword.kwlist) - {"and", "or", "not", "if", "else"}))
_MEANT = (
    (r"#", "leave out `#` and what follows: a comment stands outside the quotation marks"),
    (r"&&|&", "write `and`"),
    (r"\|\|?", "write `or`"),
    (r"!(?!=)|~", "write `not`"),
    (r"<>|≠", "write `!=`"),
    (r"≤", "write `<=`"),
    (r"≥", "write `>=`"),
    (r"(?<![<>=!])=(?!=)", "compare with `==`; what the result is called stands before the colon"),
    (r"\?", "write if(condition, a, b)"),
    (r"[−–—]", "write `-`, the minus sign of the keyboard"),
    (r"[×·∙⋅•]", "write `*`"),
    (r"[÷∕]", "write `/`"),
    (r"[²³]", "write `**2`, `**3`"),
    (r"√", "write sqrt(…)"),
    (r"[“”„'\"]", "leave out the quotation marks inside the expression"),
    (rf"\b({_WORDS})\b", r"`\1` is a word of Python: call it otherwise, such as `\1_`"),
    (
        r"(?<![\w.])(\d+(?:\.\d*)?)\s*(?!(?:if|else|and|or|not)\b)([^\W\d]\w*)",
        r"write \1*\2 for a product, or write a number, without a unit",
    ),
)
CALLED = {
    "ln": "write log(a)",
    "lg": "write log10(a)",
    "pow": "write a**b",
    "power": "write a**b",
    "square": "write a**2",
    "mod": "write a % b",
    "round": "write floor(a + 0.5)",
    "sgn": "write sign(a)",
    **{f"arc{name}": f"write a{name}(a)" for name in ("sin", "cos", "tan", "sinh", "cosh", "tanh")},
    "arctan2": "write atan2(y, x)",
    "sat": "write min(max(a, lower), upper)",
    "clip": "write min(max(a, lower), upper)",
}
"""Functions of other languages, and what to write for them."""


def shown(text: str) -> str:
    """A text, or its beginning."""
    line = " ".join(text.split())
    return line if len(line) <= _SHOWN else f"{line[: _SHOWN - 1]}…"


def unreadable(text: str, offset: int = 0) -> ExpressionError:
    """The mistake of a text that is no arithmetic; offset: of the character that tells a parser so."""
    message = f"`{shown(text)}` is neither a number nor an arithmetic expression"
    for pattern, fix in _MEANT:
        if found := re.search(pattern, text):
            return ExpressionError(message, fix=found.expand(fix)).at(found.start())
    fix, opened, closed = 'write a number, or arithmetic such as "2*pi/3"', text.count("("), text.count(")")
    if opened != closed:
        fix = "close each bracket" if opened > closed else "there are more closing brackets than opening ones"
    return ExpressionError(message, fix=fix).at(offset)
