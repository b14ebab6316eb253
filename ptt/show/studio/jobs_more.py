"""Jobs of the last step and beside it: standard's figures, dexterity, poses to measure, an effect from an unknown."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from ptt.progress import Progress
from ptt.show.studio.opening import place_of
from ptt.show.studio.results import Source
from ptt.show.studio.uploads import keep_effects


def iso(source: Source, model: str, tell: Progress) -> Mapping[str, Any]:
    """As `ptt iso`: ISO 9283 figures of the run, 'figures' by name."""
    from dataclasses import replace

    from ptt.judge.iso.pose_figures import named_figures
    from ptt.show.studio.verbs import ask

    tell("figures of the standard", 0, 0)
    options = replace(source, effects=(), anyway=False).options
    found = ask(["iso", source.run, "--model", str(place_of(model)), *options])
    return {"standard": found["standard"], "figures": named_figures(found)}


def dexterity(model: str, tell: Progress) -> Mapping[str, Any]:
    """As `ptt dexterity`: its figures, and its picture as PNG."""
    from ptt.show.studio.verbs import ask

    tell("condition number over the workspace", 0, 0)
    picture = Path("dexterity.png")
    figures = ask(["dexterity", str(place_of(model)), "--plot", str(picture)])
    return {"figures": figures, "png": picture.read_bytes()}


def plan(model: str, rows: int, payloads: str, tell: Progress) -> Mapping[str, Any]:
    """As `ptt plan`: targets of a first run, and what they will tell."""
    from ptt.show.studio.verbs import ask

    tell("choosing poses", 0, 0)
    out = Path("plan.csv")
    out.unlink(missing_ok=True)
    loads = ["--payloads", payloads] if payloads.strip() else []
    told = ask(["plan", str(place_of(model)), "--out", str(out), "--rows", str(rows), *loads])
    return {"told": told, "csv": out.read_text(encoding="utf-8")}


def write_effects(name: str, dependences: Sequence[Mapping[str, Any]], tell: Progress) -> Mapping[str, Any]:
    """As `ptt effects new NAME --like D.json`: an effect for each curve that an unknown follows.

    Returns:
        'file' in the folder of effects, its 'text', and the 'names' of the effects.
    """
    from ptt.effects.prefilled import prefilled

    written = prefilled(name, dependences)
    file = f"{name.replace('-', '_')}.py"
    keep_effects(Path(), file, written.text.encode())
    return {"file": file, "text": written.text, "names": list(written.names)}
