"""What several results are called side by side: as shortly as tells them apart."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from pathlib import Path


def names(paths: Sequence[Path]) -> list[str]:
    """Their files' names without the ending, with as many folders before them as it takes; else numbered."""
    parts = [path.with_suffix("").parts for path in paths]
    depths = [1] * len(paths)
    while True:
        found = ["/".join(own[-depth:]).replace("//", "/") for own, depth in zip(parts, depths, strict=True)]
        counts = Counter(found)
        grown = [min(d + (counts[n] > 1), len(own)) for d, n, own in zip(depths, found, parts, strict=True)]
        if grown == depths:
            return _numbered(found, paths)
        depths = grown


def _numbered(found: list[str], paths: Sequence[Path]) -> list[str]:
    """Names that are still alike: with their endings, or of one file, with a number."""
    counts = Counter(found)
    whole = [str(path) if counts[name] > 1 else name for name, path in zip(found, paths, strict=True)]
    seen: Counter[str] = Counter()
    for k, name in enumerate(whole):
        seen[name] += 1
        if seen[name] > 1:
            whole[k] = f"{name} ({seen[name]})"
    return whole
