"""Where a verb may write: never onto its inputs, never onto a file of another kind. One place for all verbs."""

import functools
import inspect
import os
import re
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Annotated, Any

import typer

from ptt.commands.numbers import require_numbers
from ptt.digests import beside, listed, require_place
from ptt.door.outputs import is_commands
from ptt.errors import InputError
from ptt.files import put_digest, require_plain

Digests = Annotated[bool, typer.Option("--sha256", help="Write NAME.sha256 beside every file, as sha256sum reads it.")]
OUTPUTS = ("out", "out_run", "out_model", "truth", "plot", "plots", "drawing", "measure_next", "rig_out")
WORDS = {
    "": "empty",
    "machine": "a machine file",
    "rig": "a rig",
    "table": "a table of targets or commands",
    "page": "a page",
    "picture": "a picture",
    "python": "Python source",
    "json": "JSON",
    "export": "an export for a controller",
    "program": "a G-code program",
    "other": "another file",
}
KINDS: tuple[tuple[str, tuple[str, ...]], ...] = (  # by the end of an option's metavar: what may be replaced
    ("RIG.toml", ("rig",)),
    (".toml", ("machine",)),
    ("RUN.csv", ("readings",)),
    ("R2.csv", ("readings",)),
    (".csv", ("table",)),
    (".html", ("page",)),
    ("HTML", ("page",)),
    (".png", ("picture",)),
    ("PNG", ("picture",)),
    (".py", ("python",)),
    ("FILE", ("table",)),
    ("PATH", ("export",)),  # a folder is looked into by the format itself
    (".ngc", ("program",)),
)
ENDS = {  # suffixes of each kind of file; that of another kind is refused
    "machine": (".toml",),
    "rig": (".toml",),
    "readings": (".csv",),
    "table": (".csv",),
    "page": (".html", ".htm"),
    "picture": (".png",),
    "python": (".py",),
    "program": (".ngc",),
    "json": (".json",),
}
HEAD = 8192  # bytes of a file that tell its kind


def checked(verb: Callable[..., Any]) -> Callable[..., Any]:
    """Wrap a verb: check its numbers and outputs first, and write digests where asked.

    Args:
        verb: a function whose paths are named by typer's annotations; those named in `OUTPUTS` are written.

    Returns:
        The verb with these checks, and with an option `--sha256` where it writes files.
    """
    if getattr(verb, "outputs_checked", False):
        return verb
    metavars, options, signature = dict(_metavars(verb)), dict(_options(verb)), inspect.signature(verb)

    @functools.wraps(verb)
    def first(*args: Any, sha256: bool = False, **values: Any) -> Any:
        require_numbers(values, options)
        require_outputs(values, metavars)
        if not sha256:
            return verb(*args, **values)
        return _with_digests(lambda: verb(*args, **values), values)

    if set(signature.parameters) & set(OUTPUTS):
        option = inspect.Parameter("sha256", inspect.Parameter.KEYWORD_ONLY, default=False, annotation=Digests)
        parameters = [*signature.parameters.values(), option]
        first.__signature__ = signature.replace(parameters=parameters)  # type: ignore[attr-defined]
        first.__annotations__ = verb.__annotations__ | {"sha256": Digests}
    first.outputs_checked = True  # type: ignore[attr-defined]
    return first


def _with_digests(verb: Callable[[], Any], values: Mapping[str, Any]) -> Any:
    for name in OUTPUTS:
        if isinstance(values.get(name), Path):
            require_place(values[name])
    with listed() as written:
        done = verb()
    digests = {beside(path) for path in written}
    for path in dict.fromkeys(written):
        if path.is_file() and path not in digests:  # what went into a folder as one has its digest in that folder
            put_digest(path)
    return done


def require_outputs(values: Mapping[str, Any], metavars: Mapping[str, str]) -> None:
    """Refuse outputs that would overwrite inputs or files of another kind.

    Args:
        values: name of a verb's argument -> value.
        metavars: name -> metavar in the help, whose end says the kind of file.

    Raises:
        InputError: an output is an input, lies within a folder that is one, is named twice, or is of another kind.
    """
    outputs = {name: values[name] for name in OUTPUTS if isinstance(values.get(name), Path)}
    inputs = [path for name, value in values.items() if name not in outputs for path in _paths(value)]
    for name, out in outputs.items():
        for given in inputs:
            _require_apart(out, given)
        for other in (path for key, path in outputs.items() if key != name):
            if os.path.realpath(out) == os.path.realpath(other):
                raise InputError("is named for two outputs", where=str(out), fix="give each its own file")
        _require_kind(out, metavars.get(name, ""))


def file_kind(path: Path) -> str:
    """Kind of a file by its beginning: a key of `WORDS`, or 'readings'."""
    with path.open("rb") as file:
        head = file.read(HEAD)
    text = head.replace(b"\0", b"").decode("utf-8", "replace")  # without the zeros, UTF-16 too shows its titles
    if not text.strip("\ufeff \r\n\t"):
        return ""
    if head.startswith((b"\x89PNG", b"%PDF", b"\xff\xd8")) or text.lstrip().startswith("<svg"):
        return "picture"
    lower = text.lower().lstrip("\ufeff \r\n")
    for kind, sign in (
        ("page", r"<!doctype html|<html"),
        ("export", r"(?s).{0,4000}\bexported by ptt "),
        ("readings", r"(.*\n){0,40}?.*\bx_meas"),
        ("rig", r"(?s).*^\s*\[\[?(drive|conditions|geometry|thermal|structure|odd)\b"),
        ("machine", r"(?s).*^\s*\[machine\]"),
        ("table", r"(.*\n){0,40}?[^\n]*\b(x_cmd|b1|q1|b1_cmd|q1_cmd|q1_cmd_rad|x_true)\b.*[,;\t]"),
        ("json", r'\{|\[\s*([\[{"\]\-\d]|true\b|false\b|null\b)'),  # [printer] is a section of a controller's file
        ("program", r"%\s*$|\(|;|/?\s*(n\d+\s*)?[gmtfsoxyz]\s*[-+.]?\d"),
        ("python", r'"""|\'\'\'|import |from |class |#!.*python'),
    ):
        if re.match(sign, lower, re.MULTILINE):
            return kind
    return "other"


def _paths(value: Any) -> Iterator[Path]:
    """Existing paths among the values of one argument."""
    for each in value if isinstance(value, list | tuple) else (value,):
        if isinstance(each, Path) and os.path.lexists(each):
            yield each


def _require_apart(out: Path, given: Path) -> None:
    """Refuse an output that is an input, through links as well, or lies within an input folder."""
    first, second = Path(os.path.realpath(out)), Path(os.path.realpath(given))
    same = first == second or (first.exists() and second.exists() and first.samefile(second))
    if same and not second.is_dir():
        raise InputError(f"is the input {given}, which would be lost", where=str(out), fix="name another file")
    if (second / "compensator.json").exists() and first.is_relative_to(second):
        raise InputError(f"lies within the input {given}, which would be spoilt", where=str(out), fix="name another")
    if first.is_dir() and second.parent == first and second.name == "model.toml":
        raise InputError(f"holds the input {given}, which would be lost", where=str(out), fix="name another folder")


def _require_kind(out: Path, metavar: str) -> None:
    """Refuse to replace an existing file by one of another kind."""
    expected = next((kinds for end, kinds in KINDS if metavar.endswith(end)), None)
    target = Path(os.path.realpath(out))
    if metavar == "DIR" and target.exists() and not target.is_dir():
        raise InputError("is a file, not a folder", where=str(out), fix="name another folder")
    if expected is None or (metavar == "PATH" and target.is_dir()):
        return
    require_plain(target, out)
    found = file_kind(target) if target.exists() else ""
    if found == "readings" and metavar == "SLIDERS.csv" and is_commands(target):
        return  # whose readings they are is looked at when the targets are read
    if found and found not in expected:
        what = "holds readings" if found == "readings" else f"is {WORDS[found]}, which would be lost"
        raise InputError(f"{what}; nothing was written", where=str(out), fix="name another file")
    if metavar != "FILE":
        _require_end(out, expected)


def _require_end(out: Path, expected: tuple[str, ...]) -> None:
    """Refuse a name with the suffix of another kind of file."""
    own, end = [each for kind in expected for each in ENDS.get(kind, ())], out.suffix.lower()
    if own and end not in own and any(end in ends for ends in ENDS.values()):
        what = f"ends in {end}, but would be {WORDS.get(expected[0], 'a tracker run')}"
        raise InputError(what, where=str(out), fix=f"let its name end in {own[0]}")


def _options(verb: Callable[..., Any]) -> Iterator[tuple[str, str]]:
    """Arguments of a verb with their options."""
    for name, hint in verb.__annotations__.items():
        for extra in getattr(hint, "__metadata__", ()):
            called = getattr(extra, "default", None)  # where typer puts the first of the names that it is given
            if isinstance(called, str) and called.startswith("--"):
                yield name, called.partition("/")[0]


def _metavars(verb: Callable[..., Any]) -> Iterator[tuple[str, str]]:
    """Arguments of a verb with their metavars."""
    for name, hint in verb.__annotations__.items():
        for extra in getattr(hint, "__metadata__", ()):
            if getattr(extra, "metavar", None):
                yield name, extra.metavar
