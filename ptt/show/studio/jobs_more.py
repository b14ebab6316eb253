"""Jobs of the tools: figures of ISO 9283, dexterity, planning of poses, and effects written from an unknown."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from ptt.progress import Progress
from ptt.show.studio.opening import open_both, place_of
from ptt.show.studio.results import Source
from ptt.show.studio.uploads import keep_effects


def iso(source: Source, model: str, tell: Progress) -> Mapping[str, Any]:
    """As `ptt iso`: 'standard' and 'figures' by name."""
    from ptt.door.result import plain
    from ptt.errors import TableError
    from ptt.judge.iso.figures import iso_of_problem
    from ptt.judge.iso.pose_figures import named_figures

    tell("figures of the standard", 0, 0)
    try:
        found = plain(iso_of_problem(open_both(source, model).problem).to_dict())
    except TableError as error:
        raise type(error)(error.what, where=error.where or source.run, fix=error.fix) from error
    return {"standard": found["standard"], "figures": named_figures(found)}


def dexterity(source: Source, model: str, tell: Progress) -> Mapping[str, Any]:
    """As `ptt dexterity`: 'figures' and the picture, 'png'."""
    from ptt.door.model import load
    from ptt.door.result import plain
    from ptt.mechanisms.dexterity_report import describe_dexterity
    from ptt.show.plots.common import png
    from ptt.show.plots.workspace import draw_dexterity

    tell("condition number over the workspace", 0, 0)
    file = load(place_of(model), effects=source.effect_files).file
    return {"figures": plain(describe_dexterity(file)), "png": png(draw_dexterity(file.machine))}


def plan(source: Source, model: str, rows: int, payloads: str, tell: Progress) -> Mapping[str, Any]:
    """As `ptt plan`: targets of a first run as 'csv', and what they will determine, 'told'."""
    from ptt.door.model import load
    from ptt.door.options import parse_numbers
    from ptt.door.result import plain
    from ptt.plan.first_run import plan_first_run
    from ptt.run.written import table_to_frame

    tell("choosing poses", 0, 0)
    loaded, loads = load(place_of(model), effects=source.effect_files), parse_numbers(payloads, "--payloads")
    result = plan_first_run(loaded.physics, rows=rows, payloads=loads, known=loaded.library, progress=tell)
    csv = table_to_frame(result.targets).to_csv(index=False, lineterminator="\n")
    return {"told": plain(result.to_dict()), "csv": csv}


def write_effects(name: str, dependences: Sequence[Mapping[str, Any]], tell: Progress) -> Mapping[str, Any]:
    """As `ptt effects new NAME --like D.json`: write an effect for each variable that an unknown depends on.

    Returns:
        'file': its name in the folder of effects; 'text': its content; 'names': names of the effects in it.
    """
    from ptt.effects.prefilled import prefilled

    written = prefilled(name, dependences)
    file = f"{name.replace('-', '_')}.py"
    keep_effects(Path(), file, written.text.encode())
    return {"file": file, "text": written.text, "names": list(written.names)}
