"""documentation/index.html of an FMU: what its blocks compute, its variables, and how it was exported."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from html import escape
from importlib import resources
from itertools import groupby
from string import Template
from textwrap import dedent

import numpy as np

from cosim.authoring.variables import Unit
from cosim.export.about import About
from cosim.export.model import FmiVariable, Model
from cosim.export.model_description import ModelDescription
from cosim.results.software_versions import versions
from cosim.wiring.network import Component

SHOWN = 6  # numbers of an array


def page(description: ModelDescription) -> str:
    """The page."""
    model, about = description.model, description.about
    template = Template(resources.files("cosim.export").joinpath("documentation.html").read_text(encoding="utf-8"))
    interface = f"FMI {description.version.name} for Co-Simulation and Model Exchange"
    version = f"cosim {versions().get('cosim', '')}".strip()
    date = f", {about.date}" if about.date else ""
    return template.substitute(
        title=escape(model.name),
        facts=escape(f"{interface}, exported by {version}{date}"),
        about=_facts(about),
        sections="\n".join(_section(model, component) for component in model.network.components.values()),
        settings=_list(_settings(description)),
    )


def _facts(about: About) -> str:
    facts = [f"<dt>{key}</dt><dd>{escape(value)}</dd>" for key, value in replace(about, date="").attributes().items()]
    for path in about.files():
        link = path.removeprefix("documentation/")
        facts.append(f'<dt>license text</dt><dd><a href="{link}">{link}</a></dd>')
    return f"<dl>{''.join(facts)}</dl>" if facts else ""


def _section(model: Model, component: Component) -> str:
    """A block: its text, and its variables."""
    several = len(model.network.components) > 1
    declaration = component.declaration
    title = f"{component.name}: {declaration.name}" if several else declaration.name
    rows = [_row(model, v) for v in model.variables if v.signal.component == component.name and not v.state]
    return "\n".join([f"<h2>{escape(title)}</h2>", *_paragraphs(declaration.doc), _table(rows)])


def _paragraphs(doc: str) -> Iterator[str]:
    """A docstring: what is indented stands as it is written."""
    parts = [part.removesuffix("::").rstrip("\n") for part in re.split(r"\n\s*\n", doc.strip("\n"))]
    for indented, group in groupby(filter(str.strip, parts), lambda part: part.startswith((" ", "\t"))):
        if indented:
            text = dedent("\n\n".join(group))
            yield f"<pre>{escape(text)}</pre>"
        else:
            yield "\n".join(f"<p>{_words(part)}</p>" for part in group)


def _words(sentence: str) -> str:
    """A sentence, what stands in backquotes as code."""
    return re.sub("`([^`]+)`", r"<code>\1</code>", escape(sentence))


def _table(rows: Sequence[dict[str, str]]) -> str:
    """Without the columns in which nobody has anything."""
    head = [name for name in (rows[0] if rows else ()) if any(row[name] for row in rows)]
    titles = "".join(f"<th>{name}</th>" for name in head)
    body = "\n".join("<tr>" + "".join(f"<td>{escape(row[name])}</td>" for name in head) + "</tr>" for row in rows)
    return f'<div class="wide"><table><thead><tr>{titles}</tr></thead><tbody>\n{body}\n</tbody></table></div>'


def _row(model: Model, v: FmiVariable) -> dict[str, str]:
    kind = [v.causality if v.kind == "PARAMETER" else f"{v.variability} {v.causality}"]
    kind += ["state"] if v.kind == "CONTINUOUS_STATE" else []
    kind += [v.dtype.name] if v.dtype != float else []
    knowns = [k.name for k in model.variables if k.signal in v.knowns and not k.state and k.signal != v.signal]
    return {
        "variable": v.name + (f"[{', '.join(map(str, v.shape))}]" if v.shape else ""),
        "kind": ", ".join(kind),
        "unit": _unit(v.unit) + (f", shown in {_unit(v.display)}" if v.display else ""),
        "start": _numbers(v.start) + (", unless it is given" if v.initial == "approx" else ""),
        "min": _numbers(v.min),
        "max": _numbers(v.max),
        "nominal": _numbers(v.nominal),
        "depends at once on": ", ".join(knowns) if v.need == "EVALUATED" else "",
        "meaning": v.description,
    }


def _unit(unit: Unit) -> str:
    return ", ".join(unit) if isinstance(unit, tuple) else unit or ""


def _numbers(values: np.ndarray | None) -> str:
    """The first numbers, or the one that all of them are; modelDescription.xml has them to the last bit."""
    if values is None or not values.size:
        return ""
    flat = values.reshape(-1)
    shown = flat[:SHOWN] if (flat != flat[0]).any() else flat[:1]
    texts = [f"{value:.6g}" if value.dtype.kind == "f" else str(value) for value in shown]
    return " ".join(texts) + (" …" if 1 < len(texts) < len(flat) else "")


def _list(sentences: Iterable[str]) -> str:
    return "<ul>" + "\n".join(f"<li>{_words(sentence)}</li>" for sentence in sentences) + "</ul>"


def _settings(description: ModelDescription) -> Iterator[str]:
    """The settings with which it was exported, in sentences."""
    model, run = description.model, description.model.network.diagram.run
    yield (
        f"As Co-Simulation, a communication step is divided into equal inner steps of at most {run.step:g} s, at each "
        "of which the blocks exchange their values. As Model Exchange, the importer integrates."
    )
    for component in model.network.components.values():
        if component.declaration.continuous():
            integration = component.integration
            steps = f", {integration.inner_steps} steps in each inner step" if integration.inner_steps > 1 else ""
            yield f"{component.name} is integrated by `{integration.integrator}`{steps}, with its inputs held."
        if component.declaration.kind("update"):
            yield f"{component.name} is sampled {component.clock}."
        for port, sources in component.wires.items():
            yield f"{component.name}.{port} ← {', '.join(map(str, sources))}"
    yield (
        "Directional derivatives are differences of fourth order, exact to some 3e-12 of what they are taken of, where "
        "that changes smoothly over the nominal values."
    )
    if model.program.loops:
        torn = ", ".join(str(signal) for loop in model.program.loops.values() for signal in dict.fromkeys(loop.torn))
        yield f"Algebraic loops are solved by Newton's method at every evaluation, for {torn}."
    if description.with_sources:
        yield (
            f"sources/{model.identifier}.c, which includes all others, compiles to the same as C11 by GCC or Clang, "
            "with FMI's headers and the C library's mathematical functions."
        )
    if model.left_out:
        yield f"Left out, as not finite at the initialization: {', '.join(map(str, model.left_out))}."
