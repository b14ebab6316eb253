"""Jobs on files before a run is opened: its columns, the machine file, and correcting the set-up."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from ptt.progress import Progress
from ptt.show.studio.opening import place_of
from ptt.show.studio.results import ANSWERS, COLUMNS, MENDED, Source

SAMPLE = 6  # rows of the preview


def peek(source: Source, tell: Progress) -> Mapping[str, Any]:
    """Guess what each column of a run holds, without asking; with the first rows as a preview.

    Returns:
        'columns': for each 'title', 'cells' of the preview, 'quantity' ('' for unknown) and 'unit' (None for unknown);
        'rows': number of rows; 'how': encoding, delimiter and decimal sign in words.
    """
    from ptt.run.readers import Mapping as Answers
    from ptt.run.readers import load_mapping
    from ptt.run.readers.clock import names_a_date
    from ptt.run.readers.columns import UNITS, dimension_of
    from ptt.run.readers.export import Request, read_titles
    from ptt.run.readers.separators import split_line
    from ptt.run.readers.stamps import is_dated_stamp, is_stamp

    known = load_mapping(source.map_) if source.map_ and Path(source.map_).exists() else Answers()
    raw, titles, meanings = read_titles(source.run, Request("run", known))
    rows = [split_line(line, raw.delimiter) for line in raw.body[:SAMPLE]]
    found, timed = [], any(meaning and meaning.quantity == "time" for meaning in meanings)
    for index, (title, meaning) in enumerate(zip(titles, meanings, strict=True)):
        quantity = known.columns.get(title, meaning.quantity if meaning else "")
        quantity = "" if quantity == "ignore" else quantity
        cells = [row[index] for row in rows if index < len(row)]
        if (
            not (quantity or timed or title in known.columns)
            and names_a_date(title)
            and all(map(is_dated_stamp, cells))
        ):
            quantity = "time"
        if quantity in ("x", "y", "z"):
            quantity = f"{quantity}_meas"
        unit = known.units.get(title) or (meaning.unit if meaning else None)
        if unit is None and quantity == "time" and any(map(is_stamp, cells)):
            unit = "stamp"
        units = list(UNITS.get(dimension_of(quantity), {}))
        found.append(
            {
                "title": title, "cells": [row[index] if index < len(row) else "" for row in rows], "quantity": quantity,
                "unit": unit if unit in units else None,
            }
        )  # fmt: skip
    how = f"{raw.encoding}, cells parted by '{raw.delimiter}', decimal sign '{raw.decimal}'"
    return {"columns": found, "rows": len(raw.body), "how": how}


def columns(source: Source, quantities: Mapping[str, str], units: Mapping[str, str], tell: Progress) -> Source:
    """Save what a person entered about the columns as a file for --map; any earlier answers are discarded.

    Returns:
        The source that is read with this file.
    """
    from ptt.run.readers import Mapping as Answers
    from ptt.run.readers import load_mapping, save_mapping

    before = source.mapping
    known = load_mapping(before) if before and Path(before).exists() else Answers()
    save_mapping(replace(known, columns=dict(quantities), units=dict(units)), COLUMNS)
    Path(ANSWERS).unlink(missing_ok=True)
    return replace(source, map_=COLUMNS, answers=())


def describe(machine: str, tell: Progress) -> Mapping[str, Any]:
    """A machine file in words, with its picture: of a 3-PTT as SVG, of an arm as a chain of points, (m, 3) mm."""
    import io

    from matplotlib.backends.backend_svg import FigureCanvasSVG

    from ptt.machine import parse_machine
    from ptt.setup.machine import describe_machine
    from ptt.show.plots.machine import draw_machine
    from ptt.show.studio.looks import rest_of_arm

    file = parse_machine(machine, "machine.toml")
    said = describe_machine(file)
    if said.kind == "serial":
        return {"words": str(said), "svg": "", "chain": rest_of_arm(file)}
    figure, buffer = draw_machine(file, words=False), io.BytesIO()
    FigureCanvasSVG(figure).print_svg(buffer)
    svg = buffer.getvalue().decode()
    return {"words": str(said), "svg": svg[svg.index("<svg") :], "chain": []}


def mend(source: Source, machine: str, tell: Progress) -> tuple[Source, str]:
    """As `ptt check --out-run --out-model`: copies of run and machine in which sure mistakes are corrected.

    Returns:
        The source of the corrected run, and text of the corrected machine.toml.
    """
    from ptt.door.checking import check_path
    from ptt.door.model import load
    from ptt.errors import InputError
    from ptt.machine import format_machine
    from ptt.run.written import write_table

    tell("putting it right", 0, 0)
    if source.also:
        raise InputError("one file for several runs", where="--out-run", fix="check each run separately")
    loaded = load(place_of(machine), effects=source.effect_files)
    found = check_path(loaded, source.run, source.reading())
    assert found.table is not None
    write_table(found.table, MENDED, as_read=True)
    return Source(MENDED, effects=source.effects), format_machine(found.file)
