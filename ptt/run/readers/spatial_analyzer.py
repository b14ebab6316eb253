"""Point exports of SpatialAnalyzer: `// AXES = CARTESIAN: X, Y, Z (mm)`, then `group, name, 0, x, y, z, stamp`.

Names have none to three parts; a point that was renamed ends on `*`; stamps may be missing.
"""

import re
from dataclasses import replace

from ptt.errors import TableError
from ptt.run.readers.layout import refuse_polar
from ptt.run.readers.separators import is_number, split_line
from ptt.run.readers.text import RawText

_AXES = re.compile(r"axes\s*=\s*(\w+)\s*:?\s*([^()]*)(?:\(([^)]*)\))?", re.IGNORECASE)
_NOT_CARTESIAN = re.compile(r"\b(polar|cylindrical|spherical)\b", re.IGNORECASE)


def check_axes(raw: RawText) -> None:
    """Refuse a file whose comments say that it does not hold Cartesian coordinates."""
    for comment in raw.comments:
        if _NOT_CARTESIAN.search(comment):
            refuse_polar(raw.source, f"the file says '{comment}'")


def is_spatial_analyzer(raw: RawText) -> bool:
    """Whether a comment says so."""
    return raw.header is None and any("spatialanalyzer" in text.lower() or _AXES.search(text) for text in raw.comments)


def reshape(raw: RawText) -> tuple[RawText, list[str]]:
    """Bring rows with names of any number of parts to the columns name, x, y, z and time.

    Args:
        raw: the lines.

    Returns:
        The same rows under titles, and what was understood.

    Raises:
        TableError: a row without three coordinates.
    """
    rows = [split_line(line, raw.delimiter) for line in raw.body]
    starts = [_coordinates_start(row, raw, index) for index, row in enumerate(rows)]
    offsets = {row[start - 1] for row, start in zip(rows, starts, strict=True) if start}
    has_offset = len(offsets) == 1 and is_number(next(iter(offsets)), raw.delimiter)
    parts = [row[: start - has_offset] for row, start in zip(rows, starts, strict=True)]
    names, notes = _names(parts)
    axes, unit = _axes(raw)
    header = ("name", *(f"{axis} [{unit}]" if unit else axis for axis in axes), "time")
    body = [
        "\t".join((f'"{name}"', *row[start : start + 3], row[start + 3] if len(row) > start + 3 else ""))
        for name, row, start in zip(names, rows, starts, strict=True)
    ]
    return replace(raw, header=header, body=body, delimiter="\t"), ["layout: SpatialAnalyzer points", *notes]


def _coordinates_start(row: list[str], raw: RawText, index: int) -> int:
    end = len(row)
    while end and not is_number(row[end - 1], raw.delimiter):
        end -= 1
    if end < 3 or len(row) - end > 1 or not all(is_number(cell, raw.delimiter) for cell in row[end - 3 : end]):
        raise TableError(
            "no three coordinates before the time stamp",
            where=f"{raw.source} row {raw.line[index]}",
            fix="remove the row, or export the points again",
        )
    return end - 3


def _names(parts: list[list[str]]) -> tuple[list[str], list[str]]:
    """The last part names the point; the parts before are kept where there is more than one group."""
    bare = [[part.rstrip("*").strip().replace('"', "'") for part in row if part] for row in parts]
    stars = sum(any(part.endswith("*") for part in row) for row in parts)
    groups = {tuple(row[:-1]) for row in bare if row}
    notes = [f"names: {stars} ended on '*' (renamed points), the mark is dropped"] if stars else []
    if len(groups) > 1:
        return ["/".join(row) for row in bare], [*notes, f"names: group/point, {len(groups)} groups"]
    group = "/".join(next(iter(groups), ()))
    notes += [f"names: all points in group '{group}'"] if group else []
    return [row[-1] if row else "" for row in bare], notes


def _axes(raw: RawText) -> tuple[list[str], str]:
    for comment in raw.comments:
        match = _AXES.search(comment)
        if match:
            axes = [word.strip().lower() for word in match[2].split(",") if word.strip()]
            if sorted(axes) == ["x", "y", "z"]:
                return axes, (match[3] or "").strip()
    return ["x", "y", "z"], ""
