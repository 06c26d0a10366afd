r"""LaTeX tables: every text is escaped, numbers are mathematics, and LaTeX itself takes them where there is one."""

import shutil
import subprocess

import pytest

from cosim.results.latex_tables import escape, latex
from cosim.results.text_table import TextTable

ODD = "50 % of A_b & C# costs $5 {~^\\} <α|β> ‖δ‖ é “x” m² x₁ — 1–2 … ± × ∞ ≤ Ω Α ς µ" + "\"`'"


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("a_b", r"a\_b"),
        ("100 %", r"100 \%"),
        ("$x$", r"\$x\$"),
        ("A & B", r"A \& B"),
        ("#1 {x}", r"\#1 \{x\}"),
        ("a\\b", r"a\textbackslash{}b"),
        ("δ_x", r"$\delta$\_x"),
        ("Ω, Α", r"$\Omega$, A"),
        ("m²", "m$^{2}$"),
        ("a\nb", "a, b"),
        ("tab\there", "tab here"),
        ("größe", "größe"),
    ],
)
def test_texts_are_printed_as_they_stand(text, expected):
    assert escape(text) == expected


def test_numbers_are_mathematics():
    table = TextTable("A_1", ["v", "x", "y"], [["a", "-1.2e-05", "1.5 ± 0.2"], ["b", "40.0%", "—"]], [[1, 2], [3, 4]])
    text = latex(table)
    assert r"a & $-1.2 \times 10^{-5}$ & $1.5 \pm 0.2$ \\" in text
    assert r"b & $40.0\,\%$ & --- \\" in text
    assert r"\caption{A\_1}" in text and r"\begin{tabular}{lrr}" in text and r"\label{tab:a-1}" in text


def test_latex_takes_it(tmp_path):
    program = shutil.which("pdflatex")
    if program is None:
        pytest.skip("no pdflatex: apt-get install texlive-latex-recommended")
    table = TextTable(ODD, [ODD, "x"], [[ODD, "1.0e+03 ± 2"], ["-3", "nan"]], [[1.0], [2.0]], [ODD])
    head = "\\documentclass{article}\\usepackage[T1]{fontenc}\\usepackage{textcomp,booktabs}\\begin{document}\n"
    (tmp_path / "a.tex").write_text(head + latex(table) + "\n\\end{document}\n")
    command = [program, "-interaction=nonstopmode", "-halt-on-error", "a.tex"]
    done = subprocess.run(
        command, cwd=tmp_path, capture_output=True, text=True, errors="replace", timeout=60, check=False
    )
    assert done.returncode == 0, done.stdout[-2000:]
