r"""Tables in LaTeX, as a paper includes them: booktabs' rules, every text escaped, numbers set as mathematics.

They need `\usepackage{booktabs}`; what is not ASCII is set by commands, but for letters of other scripts.
"""

from __future__ import annotations

import re
import unicodedata

from cosim.results.text_table import TextTable

ESCAPES = {
    **{c: f"\\{c}" for c in "&%$#_{}"},
    **{"\\": r"\textbackslash{}", "~": r"\textasciitilde{}", "^": r"\textasciicircum{}"},
    **{"<": r"\textless{}", ">": r"\textgreater{}", "|": r"\textbar{}", '"': r"\textquotedbl{}"},
    **{"—": "---", "–": "--", "…": r"\ldots{}", "‖": r"$\|$", "µ": r"\textmu{}", "°": r"\textdegree{}"},
    **{"±": r"$\pm$", "×": r"$\times$", "·": r"$\cdot$", "∞": r"$\infty$", "≤": r"$\leq$", "≥": r"$\geq$"},
    **{"≠": r"$\neq$", "√": r"$\surd$", "−": "$-$", "→": r"$\to$", "\n": ", ", "`": r"\textasciigrave{}"},
}
_NUMBER = re.compile(r"(?P<sign>-?)(?P<digits>\d+\.?\d*)(?:e(?P<power>[-+]\d+))?(?P<unit>%?)")
_SCRIPTS = {"SUPERSCRIPT": "^", "SUBSCRIPT": "_"}
_LOOKS_LATIN = {
    **{"alpha": "A", "beta": "B", "epsilon": "E", "zeta": "Z", "eta": "H", "iota": "I", "kappa": "K", "mu": "M"},
    **{"nu": "N", "o": "O", "rho": "P", "tau": "T", "chi": "X"},
}


def latex(table: TextTable) -> str:
    """The table, with its title as its caption. Its label is `tab:` and the title's letters and digits."""
    labels = table.labels
    lines = [r"\begin{table}", r"  \centering"]
    if table.title:
        lines += [rf"  \caption{{{escape(table.title)}}}", rf"  \label{{tab:{_label(table.title)}}}"]
    columns = "l" * labels + "r" * (len(table.head) - labels)
    lines += [rf"  \begin{{tabular}}{{{columns}}}", r"    \toprule"]
    lines += [_row([escape(cell) for cell in table.head]), r"    \midrule"]
    lines += [_row([*map(escape, row[:labels]), *map(_figure, row[labels:])]) for row in table.rows]
    lines += [r"    \bottomrule", r"  \end{tabular}"]
    lines += [rf"  \par\smallskip {escape(note)}" for note in table.notes]
    return "\n".join([*lines, r"\end{table}"])


def escape(text: str) -> str:
    """A text that LaTeX prints as it stands."""
    return "".join(ESCAPES.get(c) or _other(c) for c in text)


def _row(cells: list[str]) -> str:
    return f"    {' & '.join(cells)} \\\\"


def _figure(text: str) -> str:
    """A cell: a number, or two with ± between, as mathematics; anything else as text."""
    parts = [_NUMBER.fullmatch(part) for part in text.split(" ± ")]
    numbers = [_number(part) for part in parts if part]
    return "$" + r" \pm ".join(numbers) + "$" if len(numbers) == len(parts) <= 2 else escape(text)


def _number(match: re.Match[str]) -> str:
    power = rf" \times 10^{{{int(match['power'])}}}" if match["power"] else ""
    return match["sign"] + match["digits"] + power + (r"\,\%" if match["unit"] else "")


def _other(c: str) -> str:
    """A Greek letter, or a raised or lowered digit, as mathematics; a letter of another script as it is."""
    if c.isascii():
        return c if c.isprintable() else " "
    name = unicodedata.name(c, "").split()
    if name[:1] == ["GREEK"] and "LETTER" in name and "WITH" not in name:
        letter = "sigma" if name[-2:] == ["FINAL", "SIGMA"] else name[-1].lower()
        return _greek(letter, capital="CAPITAL" in name)
    plain = unicodedata.normalize("NFKD", c)
    if name and name[0] in _SCRIPTS and plain.isalnum():
        return f"${_SCRIPTS[name[0]]}{{{plain}}}$"
    return c if c.isprintable() else " "


def _greek(letter: str, capital: bool) -> str:
    """A command: LaTeX has those capitals that do not look like Latin ones."""
    if letter in ("omicron", "lamda"):
        letter = {"omicron": "o", "lamda": "lambda"}[letter]
    if not capital:
        return f"${'' if letter == 'o' else chr(92)}{letter}$"
    known = ("gamma", "delta", "theta", "lambda", "xi", "pi", "sigma", "upsilon", "phi", "psi", "omega")
    return f"$\\{letter.capitalize()}$" if letter in known else _LOOKS_LATIN.get(letter, "O")


def _label(title: str) -> str:
    return "-".join(re.findall(r"[a-z0-9]+", title.lower())) or "table"
