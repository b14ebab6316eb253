"""Jobs of the tools: figures of ISO 9283, dexterity, planning of poses, and effects written from an unknown."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from ptt.progress import Progress
from ptt.show.studio.opening import place_of
from ptt.show.studio.results import DEXTERITY, PLAN, Source
from ptt.show.studio.uploads import keep_effects


def iso(source: Source, model: str, tell: Progress) -> Mapping[str, Any]:
    """As `ptt iso`: 'standard' and 'figures' by name."""
    from dataclasses import replace

    from ptt.judge.iso.pose_figures import named_figures
    from ptt.show.studio.verbs import run_verb_json

    tell("figures of the standard", 0, 0)
    options = replace(source, effects=(), anyway=False).options
    found = run_verb_json(["iso", source.run, "--model", str(place_of(model)), *options])
    return {"standard": found["standard"], "figures": named_figures(found)}


def dexterity(model: str, tell: Progress) -> Mapping[str, Any]:
    """As `ptt dexterity`: 'figures' and the picture, 'png'."""
    from ptt.show.studio.verbs import run_verb_json

    tell("condition number over the workspace", 0, 0)
    picture = Path(DEXTERITY)
    figures = run_verb_json(["dexterity", str(place_of(model)), "--plot", str(picture)])
    return {"figures": figures, "png": picture.read_bytes()}


def plan(model: str, rows: int, payloads: str, tell: Progress) -> Mapping[str, Any]:
    """As `ptt plan`: targets of a first run as 'csv', and what they will determine, 'told'."""
    from ptt.show.studio.verbs import run_verb_json

    tell("choosing poses", 0, 0)
    out = Path(PLAN)
    out.unlink(missing_ok=True)
    loads = ["--payloads", payloads] if payloads.strip() else []
    told = run_verb_json(["plan", str(place_of(model)), "--out", str(out), "--rows", str(rows), *loads])
    return {"told": told, "csv": out.read_text(encoding="utf-8")}


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
