"""Every key of a study, declared once, as those of a diagram are in `cosim.language.keys`."""

from __future__ import annotations

from dataclasses import replace

from cosim.language.keys import (
    ANY,
    ANYTHING,
    DATA,
    DIAGRAM,
    NAMED,
    NUMBER,
    POSITIVE,
    TEXT,
    TRUTH,
    Key,
    between,
    choice,
    count,
)
from cosim.plot.figures import FIGURE
from cosim.study.definition import CONDITIONS, METHODS, MOST_MEMBERS

VALUES = {ANY: Key("", DATA)}
OVERLAY = {name: replace(key, layer=True) for name, key in DIAGRAM.items() if name not in ("title", "extends")}
VARIANT: dict[str, Key] = {
    "diagram": Key("another diagram; none: that of the study", TEXT),
    "description": Key("what it is, in words", TEXT, ""),
    "swap": Key("block types to replace, by block, as of --swap", below=NAMED),
    "set": Key("values to set, by path, as of --set", below=NAMED, layer=True),
    **OVERLAY,
}
AXIS: dict[str, Key] = {
    "path": Key("what it sets; several with commas between", TEXT),
    "values": Key("a list, {linspace: …}, {geomspace: …}, {range: …}, or values by name", ANYTHING),
}
CROSSED: dict[str, Key] = {
    "variants": Key(
        "changes of the diagram, by name, crossed with all others",
        below={ANY: Key("", below={name: key for name, key in VARIANT.items() if name != "diagram"})},
    ),
}
RANDOM: dict[str, Key] = {
    "count": Key("how many draws of each variant and grid point", count(MOST_MEMBERS), example="100"),
    "seed": Key("whole number from 0; the same gives the same draws", ANYTHING, 0),
    "method": Key("how draws are spread", choice(METHODS), METHODS[0]),
    "draws": Key("what is drawn, by path: {uniform: [least, most]} or {normal: [mean, deviation]}", below=NAMED),
    "accept": Key("bounds, by signal, that a draw has to keep at time zero: {least, most}", below=NAMED),
}
UNTIL: dict[str, Key] = {
    "probability": Key("draws end where the probability is surely below or above this", between(0.0, 1.0)),
    "confidence": Key("in that", between(0.5, 1.0), 0.99),
    "above": Key("of a metric: a violation is a value above this", NUMBER),
    "below": Key("of a metric: a violation is a value below this", NUMBER),
}
SEARCH: dict[str, Key] = {
    "over": Key("what is varied, by path, as `random.draws`: {uniform: [least, most]}", below=NAMED),
    "accept": RANDOM["accept"],
    "requirements": Key("which requirements are to be violated; none: each of them", ANYTHING),
    "runs": Key("how many runs at most for each", count(MOST_MEMBERS), 2000),
    "seed": RANDOM["seed"],
}
BOUNDS: dict[str, Key] = {
    "least": Key("the lower bound", NUMBER, float("-inf")),
    "most": Key("the upper bound", NUMBER, float("inf")),
}
TUNE: dict[str, Key] = {
    "over": Key("what is free, by path: {uniform: [least, most]}", below=NAMED),
    "minimise": Key("a metric, or arithmetic in metrics: its mean over the study's draws becomes small", TEXT),
    "subject": Key("bounds, by metric, that each run has to keep: {least, most}", below=NAMED),
    "conditions": Key("which of the theorems' conditions have to hold", choice(CONDITIONS), CONDITIONS[0]),
    "accuracy": Key("by how much figures may differ from those at a tenth of the step, of their size", NUMBER, 0.05),
    "held_out": Key("how many of the study's draws are not tuned with, but looked at in the end", count(), 0),
    "runs": Key("how many runs at most", count(MOST_MEMBERS), 1000),
    "seed": RANDOM["seed"],
}
MEASURED: dict[str, Key] = {
    "column": Key("the column of the data that has it", TEXT),
    "unit": Key("of that column; none: the signal's", TEXT),
    "deviation": Key("the standard deviation of its noise; none: found from the residuals", POSITIVE),
    "nominal": Key("what counts as one beside other columns, where no deviation is known", POSITIVE, 1.0),
}
FIT: dict[str, Key] = {
    "over": Key("what is free, by path: {uniform: [least, most]}", below=NAMED),
    "data": Key("the measured table, a CSV file", TEXT),
    "time": Key("its column of times", TEXT, "time", unit="s"),
    "signals": Key("what is measured, block.port or block.port[1]: {column: …}", below=NAMED),
    "starts": Key(
        "from how many points it is searched: the diagram's values, and others within the bounds", count(), 4
    ),
    "runs": Key("how many runs at most", count(MOST_MEMBERS), 1000),
    "seed": RANDOM["seed"],
}
COLUMN: dict[str, Key] = {
    "metric": Key("which metric; or step_time, the wall-clock time of a step (us)", ANYTHING),
    "over": Key("how draws are reduced: a statistic, a quantile from 0 to 1, or [mean, std]", ANYTHING),
    "above": Key("the share of runs above this limit instead", NUMBER),
    "below": Key("the share of runs below this limit instead", NUMBER),
    "format": Key("of its numbers, such as .2e", ANYTHING),
}
TABLE: dict[str, Key] = {
    "rows": Key("the dimensions that its rows are", ANYTHING),
    "columns": Key("metrics, or headings with {metric, over, above, below, format}", ANYTHING),
    "transpose": Key("whether rows and columns change places", TRUTH, False),
}
EXPLAIN: dict[str, Key] = {
    "baseline": Key("the variant that others are compared with", ANYTHING),
    "metric": Key("which metric", ANYTHING),
    "above": Key("a failure is a value above this", NUMBER),
    "below": Key("a failure is a value below this", NUMBER),
}
STUDY: dict[str, Key] = {
    "title": Key("what it is called; none: as its file", TEXT),
    "description": Key("what it is about, in words", TEXT, ""),
    "diagram": Key("the diagram that it is about", TEXT, example="../formation.yaml"),
    "variants": Key("changes of the diagram, by name", below={ANY: Key("", below=VARIANT)}),
    "grid": Key("lists of values, by path; or by a name: {path, values}, or {variants}", below=NAMED),
    "random": Key("what is drawn at random", below=RANDOM),
    "until": Key("draw until a probability is known, by requirement or metric; at most `random.count`", below=NAMED),
    "search": Key("where `cosim falsify` looks for what violates a requirement", below=SEARCH),
    "tune": Key("what `cosim tune` changes, and what for", below=TUNE),
    "fit": Key("what `cosim fit` changes, and the measurements that runs are to come near", below=FIT),
    "metrics": Key("names of those to keep, or definitions of further ones", ANYTHING),
    "requirements": DIAGRAM["requirements"],
    "record": Key("true, or what is recorded of each run", ANYTHING),
    "tables": Key("tables, by title", below={ANY: Key("", below=TABLE)}),
    "references": Key(
        "figures of others to compare with, by origin, variant and metric", below={ANY: Key("", below=NAMED)}
    ),
    "explain": Key("which runs failed, and what sets them apart", below=EXPLAIN),
    "figures": Key("figures, by name", below={ANY: Key("", below=FIGURE)}),
}
