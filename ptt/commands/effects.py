"""`ptt effects`: the library of physical effects, their cards and pictures, and effects of one's own."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ptt.commands.common import Effects, Json, show

if TYPE_CHECKING:
    from ptt.effects import Effect, Library
    from ptt.effects.contract import CheckOutcome

WIDTH = 110


def effects(
    what: Annotated[str | None, typer.Argument(help="An effect's NAME; or new, check, atlas.")] = None,
    argument: Annotated[str | None, typer.Argument(help="new: the NAME; check: the FILE.py.")] = None,
    plot: Annotated[Path | None, typer.Option(help="Folder for the effect's picture.")] = None,
    out: Annotated[Path | None, typer.Option(help="new: the file to write; atlas: the folder.")] = None,
    like: Annotated[
        Path | None,
        typer.Option(metavar="D.json", help="new: output of `ptt diagnose --json`, to start from the error it leaves."),
    ] = None,
    own: Effects = None,
    json: Json = False,
) -> None:
    """List the physical effects, show one effect's card, draw them all, or write and check one of your own.

    ptt effects backlash --plot pictures; ptt effects atlas --out pictures; ptt effects new cable-drag --out drag.py;
    ptt effects check drag.py
    """
    if argument is not None and what not in ("new", "check"):
        from ptt.errors import InputError

        raise InputError(f"'{argument}' is one word too many", fix="`ptt effects NAME`, `new NAME` or `check FILE.py`")
    if what == "new":
        _new(_needed(argument, "new needs a name", "ptt effects new cable-drag"), out, like, json)
    elif what == "check":
        _check(_needed(argument, "check needs a file", "ptt effects check FILE.py"), json)
    elif what == "atlas":
        _atlas(_needed(out, "atlas needs a folder", "ptt effects atlas --out DIR"), own or [], json)
    elif what is None:
        _list(own or [], json)
    else:
        _card(what, own or [], plot, json)


def _needed(value: Any, what: str, fix: str) -> Any:
    if value is None:
        from ptt.errors import InputError

        raise InputError(what, where="ptt effects", fix=f"write {fix}")
    return value


def _list(own: list[Path], json: bool) -> None:
    from ptt.effects import library
    from ptt.effects.cards import card_of

    known = library(*own)
    wide = max(len(name) for name in known)
    lines = [f"{name:<{wide}}  {cls.stage:<9}  {card_of(cls).cause}" for name, cls in known.items()]
    text = "\n".join([*lines, "", "`ptt effects NAME` shows the card of an effect."])
    show({"effects": [_describe(cls()) for cls in known.values()]}, text, json)


def _card(what: str, own: list[Path], plot: Path | None, json: bool) -> None:
    from ptt.effects import library
    from ptt.effects.registry import make_effect, parse_key

    effect = make_effect(library(*own), *parse_key(what))
    picture = None if plot is None else _draw(effect, plot)
    data = _describe(effect) | ({} if picture is None else {"picture": picture})
    show(data, _card_text(effect) + ("" if picture is None else f"\n\nwrote {picture}"), json)


def _draw(effect: "Effect", folder: Path) -> Path:
    from ptt.show.plots.effects import plot_effect

    path = folder / f"{effect.key.replace('[', ' ').replace(']', '').replace(' ', '-')}.png"
    plot_effect(effect, path)
    return path


def _atlas(folder: Path, own: list[Path], json: bool) -> None:
    from ptt.effects import library

    known: Library = library(*own)
    paths = [str(_draw(cls(), folder)) for cls in known.values()]
    show({"pictures": paths}, f"wrote {len(paths)} pictures to {folder}", json)


def _new(name: str, out: Path | None, like: Path | None, json: bool) -> None:
    from ptt.effects.prefilled import Written, prefilled
    from ptt.effects.template import template
    from ptt.errors import InputError
    from ptt.files import write_text

    if out is not None and out.suffix != ".py":
        raise InputError("an effect is a Python file", where=str(out), fix="let its name end in .py")
    written = Written((name,), template(name)) if like is None else prefilled(name, _dependences_of(like))
    if out is not None:
        if out.exists():
            raise InputError("already exists", where=str(out), fix="name another file; nothing was written")
        write_text(out, written.text)
    said = written.text.rstrip() if out is None else f"wrote {out}; edit it, then: ptt effects check {out}"
    if out is not None and written.names[1:]:
        said += f"\nadd all that it holds: ptt add RUN.csv {' '.join(written.names)} --effects {out} ..."
    told = {"name": name, "names": list(written.names), "file": out, "text": written.text}
    show(told | {"left_out": list(written.left_out)}, said, json)


def _dependences_of(path: Path) -> list[dict[str, Any]]:
    """All that a diagnosis found the error to depend on, the leading part first."""
    from ptt.documents import parse_json
    from ptt.errors import InputError
    from ptt.files import read_text

    whole = parse_json(read_text(path), str(path), fix="give what `ptt diagnose --json` printed")
    found = whole.get("depends_on") if isinstance(whole, dict) else None
    if not isinstance(found, list) or not all(isinstance(each, dict) for each in found):
        raise InputError("is not a diagnosis", where=str(path), fix="give what `ptt diagnose --json` printed")
    if not found:
        raise InputError(
            "the error it leaves depends on nothing", where=str(path), fix="start from `ptt effects new` alone"
        )
    return found


def _check(file: str, json: bool) -> None:
    from ptt.effects import library
    from ptt.effects.contract import check_effect
    from ptt.errors import ModelError
    from ptt.model.chain import differentiate

    own = {name: cls for name, cls in library(file, tried=False).items() if name not in library()}
    findings = {name: check_effect(cls(), differentiate) for name, cls in own.items()}
    broken = [(name, finding) for name, found in findings.items() for finding in found if not finding.passed]
    each = [{"name": name, "checks": [_finding(f) for f in found]} for name, found in findings.items()]
    text = "\n".join(_check_line(name, f) for name, found in findings.items() for f in found)
    show({"file": file, "passed": not broken, "effects": each}, text, json)
    if broken:
        name, first = broken[0]
        total = sum(len(found) for found in findings.values())
        said = f"{len(broken)} of {total} checks fail, first '{first.check}' of {name}: {first.broken}"
        raise ModelError(said, where=file, fix="correct the file")


def _finding(finding: "CheckOutcome") -> dict[str, Any]:
    return {"check": finding.check, "mechanism": finding.kind, "passed": finding.passed, "broken": finding.broken}


def _check_line(name: str, finding: "CheckOutcome") -> str:
    state = "ok" if finding.passed else f"BROKEN: {finding.broken}"
    return f"{name}  {finding.kind:<9}  {finding.check:<26}  {state}"


def _describe(effect: "Effect") -> dict[str, Any]:
    """Everything about an effect, for JSON."""
    from dataclasses import asdict

    from ptt.effects.cards import card_of

    card = asdict(card_of(effect))
    card["confused_with"] = [{"what": what, "separates": by} for what, by in card["confused_with"]]
    return {
        "name": effect.name,
        "label": effect.label,
        "stage": effect.stage,
        "mechanisms": list(effect.mechanisms),
        "parameters": [_parameter(p, kind) for kind in effect.mechanisms[:1] for p in effect.parameters],
        **card,
    }


def _parameter(parameter: Any, kind: str) -> dict[str, Any]:
    own = parameter.on(kind)
    keys = ("name", "unit", "usual", "lower", "upper", "per_joint", "count", "role", "meaning")
    return {key: getattr(own, key) for key in keys}


def _card_text(effect: "Effect") -> str:
    from textwrap import fill

    from ptt.effects.cards import card_of

    card = card_of(effect)
    lines = [f"{effect.key} ({effect.stage}; {', '.join(effect.mechanisms)})", ""]

    def add(title: str, text: str) -> None:
        first = f"{title:<15}"
        lines.append(fill(text, WIDTH, initial_indent=first, subsequent_indent=" " * 15, break_long_words=False))

    for title in ("cause", "equation", "source", "size", "fingerprint"):
        add(title, getattr(card, title))
    for index, (what, separates) in enumerate(card.confused_with):
        add("confused with" if index == 0 else "", f"{what} - {separates}")
    add("remedy", card.remedy)
    add("needs", card.needs)
    lines += ["", "parameters"]
    lines += [_parameter_line(parameter.on(effect.mechanisms[0])) for parameter in effect.parameters]
    return "\n".join(lines)


def _parameter_line(parameter: Any) -> str:
    unit = "" if parameter.unit == "1" else f" {parameter.unit}"
    said = [f"usual {parameter.usual:g}{unit}"]
    if parameter.lower > -float("inf"):
        said.append(f"at least {parameter.lower:g}")
    if parameter.within is not None:
        low, high = (parameter.usual * size for size in parameter.within)
        said.append(f"named from {low:g}" + (f", beyond {high:g} where its form shows" if high < float("inf") else ""))
    if parameter.role != "linear":
        said.append(parameter.role)
    if parameter.onward:
        said.append("per joint and link it carries")
    elif parameter.per_joint:
        said.append(f"{parameter.count} per leg or joint" if parameter.count > 1 else "per leg or joint")
    elif parameter.count > 1:
        said.append(f"{parameter.count} values")
    return f"  {parameter.name:<18} {', '.join(said)}: {parameter.meaning}"
