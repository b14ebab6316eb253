"""Effects of a user's own file: load it, check what it defines, and report its failures as messages on that file."""

import contextlib
import functools
import importlib.util
import inspect
import re
import sys
import warnings
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from types import ModuleType
from typing import Any

import torch

from ptt.effects.base import CONTEXTS, STAGES, Effect
from ptt.effects.bench import sample_view
from ptt.effects.layout import flatten, linear_size
from ptt.effects.parameter import Parameter
from ptt.effects.phrases import ONE, Phrase
from ptt.errors import InputError, shown
from ptt.files import read_bytes
from ptt.run.view import View

NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9 _-]{0,59}")
STEM = re.compile(r"[A-Za-z][A-Za-z0-9_]{0,59}")
MOST_VALUES = 10_000  # of one parameter: far more than any effect of the library has
FAMILIES = ("three-ptt", "serial")
ROLES = ("linear", "searched", "given")
METHODS = tuple(name for name, own in vars(Effect).items() if inspect.isfunction(own) and not name.startswith("_"))


def load_effects(path: str | Path) -> dict[str, type[Effect]]:
    """Load the effects that a user's file defines. The file is run: name only files you trust.

    Args:
        path: Python file with subclasses of `ptt.effects.Effect`.

    Returns:
        Name -> class.

    Raises:
        InputError: the file is missing, fails, or defines no effect or one whose attributes are not those of an effect.
    """
    where = str(path)
    module = _run_file(path, where)
    own = [
        value
        for value in vars(module).values()
        if isinstance(value, type) and issubclass(value, Effect) and value.__module__ == module.__name__
    ]
    if not own:
        raise InputError("defines no effect", where=where, fix="`ptt effects new NAME` writes a template")
    for cls in own:
        _check_attributes(cls, where)
        if sum(cls.name == other.name for other in own) > 1:
            raise InputError(f"defines effect '{cls.name}' twice", where=where, fix="give one of them another name")
        _guard_methods(cls, where)
        with user_code(where, f"{cls.name} cannot be made with a label"):
            if cls().key != cls.name or cls("second").key != f"{cls.name}[second]":
                raise TypeError("its constructor is not that of an effect")
    return {cls.name: cls for cls in own}


def _run_file(path: str | Path, where: str) -> ModuleType:
    if not Path(path).is_file():
        raise InputError("no such file", where=where, fix="check the path after --effects")
    spec = importlib.util.spec_from_file_location(f"ptt_own_{Path(path).stem}", path)
    if spec is None or spec.loader is None:
        raise InputError("not a Python file", where=where, fix="name a file that ends in .py")
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module  # dataclasses look their module up there
    with user_code(where, "cannot be run"):
        # Compiled here: the import system's cache would leave files behind, and miss an edit within the same second.
        exec(compile(read_bytes(path), where, "exec"), vars(module))
    return module


@contextlib.contextmanager
def user_code(where: str, what: str) -> Iterator[None]:
    """Run the user's code: any failure becomes a message on their file, and output is kept off standard output.

    Args:
        where: its file, for messages.
        what: what fails, in words.

    Yields:
        Nothing.

    Raises:
        InputError: it failed, or would have ended the process. Ctrl-C passes.
    """
    kept = torch.get_default_dtype()
    try:
        with contextlib.redirect_stdout(sys.stderr):
            yield
    except (InputError, KeyboardInterrupt):
        raise
    except SystemExit as end:
        fix = "take the call of sys.exit out"
        raise InputError(f"{what}: it ends the program (exit {shown(end.code)})", where=where, fix=fix) from None
    except BaseException as error:
        place = _line_of(error, where)
        why = f"{what}: {type(error).__name__}: {shown(str(error), 200)}"
        raise InputError(why, where=f"{where}{place}", fix="mend the file") from error
    finally:
        torch.set_default_dtype(kept)


def _line_of(error: BaseException, where: str) -> str:
    """The innermost line of the user's file in the traceback, as ' line 12'; '' where there is none."""
    trace, line = error.__traceback__, 0
    while trace is not None:
        if trace.tb_frame.f_code.co_filename == where:
            line = trace.tb_lineno
        trace = trace.tb_next
    return f" line {line}" if line else ""


def _check_attributes(cls: type[Effect], where: str) -> None:
    """Refuse a class whose name, stage, mechanisms, requirements or parameters are not those of an effect."""
    at = f"{where} class {shown(cls.__name__)}"

    def refuse(what: str, fix: str) -> None:
        raise InputError(what, where=at, fix=fix)

    if not isinstance(cls.name, str) or not NAME.fullmatch(cls.name):
        if not cls.name:
            refuse("has no name", 'write name = "my-effect" in it')
        refuse(f"name {shown(cls.name)} is not a name for an effect", 'write name = "my-effect", at most 60 letters')
    if cls.stage not in STAGES:
        refuse(f"stage '{shown(cls.stage)}' of {cls.name} is not known", f"use one of {', '.join(STAGES)}")
    for key, allowed in (("mechanisms", FAMILIES), ("requires", tuple(CONTEXTS))):
        values = getattr(cls, key)
        if not isinstance(values, tuple | list) or any(value not in allowed for value in values):
            refuse(f"{key} = {shown(values)} is not a tuple of these", f"use {key} = {allowed[:1]!r}, of {allowed}")
    if not isinstance(cls.stands_for, tuple) or not all(isinstance(name, str) for name in cls.stands_for):
        refuse(
            f"stands_for = {shown(cls.stands_for)} is not a tuple of names", 'name effects, as in ("homing-offset",)'
        )
    if not cls.mechanisms:
        refuse("mechanisms is empty: it fits no machine", f"name one of {', '.join(FAMILIES)}")
    if not isinstance(cls.parameters, tuple | list) or not all(isinstance(p, Parameter) for p in cls.parameters):
        refuse("parameters is not a tuple of Parameter(...)", "see the file that `ptt effects new NAME` writes")
    for parameter in cls.parameters:
        broken = _fault_of(parameter)
        if broken:
            refuse(f"parameter {shown(parameter.stem)}: {broken}", "mend it")
    for kind in cls.mechanisms:
        for names in ([p.stem for p in cls.parameters], [p.on(kind).name for p in cls.parameters]):
            if len(set(names)) < len(names):  # with its unit a name is a key in files
                refuse(f"two parameters have one name ({', '.join(names)})", "give each its own")
    if isinstance(cls.least_joints, bool) or not isinstance(cls.least_joints, int):
        refuse(f"least_joints = {shown(cls.least_joints)}, not a whole number", "write least_joints = 3")
    broken = _fault_of_phrases(cls)
    if broken:
        refuse(f"phrases: {broken}", "see the file that `ptt effects new NAME` writes")
    roles = [parameter.role == "linear" for parameter in cls.parameters]
    if not any(roles) or roles != sorted(roles, reverse=True):
        refuse(f"parameters of {cls.name} need a linear one, and the linear ones first", "reorder them")


def _fault_of(parameter: Parameter) -> str:
    """What is wrong with a parameter's attributes; '' where nothing is."""
    texts = (parameter.stem, parameter.unit, parameter.meaning)
    if not all(isinstance(text, str) for text in texts) or not STEM.fullmatch(parameter.stem):
        return "its name is letters, digits and _, its unit and meaning are texts"
    count = parameter.count
    if isinstance(count, bool) or not isinstance(count, int) or not 1 <= count <= MOST_VALUES:
        return f"count = {shown(count)}, not a whole number from 1 to {MOST_VALUES}"
    if parameter.role not in ROLES:
        return f"role {shown(parameter.role)}, none of {', '.join(ROLES)}"
    sizes = (parameter.usual, parameter.lower, parameter.upper, parameter.most)
    further = [size for size in (parameter.usual_rad, parameter.default) if size is not None]
    if not all(map(_is_number, (*sizes, *further))):
        return "its usual size, default and bounds are numbers"
    for usual in (parameter.usual, parameter.usual if parameter.usual_rad is None else parameter.usual_rad):
        if not 1e-100 < usual < 1e100:
            return f"usual size {usual:g}, not a positive one"
    for key in ("bands", "lent"):
        if not isinstance(getattr(parameter, key), tuple) or len(getattr(parameter, key)) not in (0, count):
            return f"{key} = {shown(getattr(parameter, key))}, not a tuple of one for each of {count}"
    within = (0.0, 1.0) if parameter.within is None else parameter.within
    if not isinstance(within, tuple) or len(within) != 2 or not all(map(_is_number, within)):
        return f"within = {shown(within)}, not two numbers"
    return "" if parameter.lower < parameter.upper else f"bounds {parameter.lower:g} and {parameter.upper:g}"


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _fault_of_phrases(cls: type[Effect]) -> str:
    """What is wrong with the words for its values; '' where nothing is."""
    if not isinstance(cls.phrases, tuple | list) or not all(isinstance(phrase, Phrase) for phrase in cls.phrases):
        return "not a tuple of Phrase(...)"
    vectors = {p.stem: not p.per_joint and p.count in (2, 3) for p in cls.parameters}
    for phrase in cls.phrases:
        axis = {"axis": "x"} if vectors.get(phrase.stem) else {}
        said, done = {"what": "1 um", **axis, **ONE}, {"what": "1 um", "who": "slider 1", "turn": ""}
        texts = [(text, said) for text in (phrase.plus, phrase.minus, *(phrase.arm or ()))]
        for text, words in (*texts, *((text, done) for text in (*phrase.mend, *phrase.arm_mend))):
            try:
                text.format(**words)
            except (AttributeError, KeyError, IndexError, ValueError):
                return f"{shown(repr(text))} has a place that is none of {', '.join(f'{{{key}}}' for key in words)}"
    return ""


def _guard_methods(cls: type[Effect], where: str) -> None:
    """Wrap the methods of the class that override those of `Effect`, so that a failure names the user's file."""
    for name in METHODS:
        own = cls.__dict__.get(name)
        if own is not None and not callable(own):
            raise InputError(f"{name} of {cls.name} is not a function", where=where, fix=f"write def {name}(self, ...)")
        if inspect.iscoroutinefunction(own):
            raise InputError(f"{name} of {cls.name} is async", where=where, fix=f"write def {name}(self, ...)")
        if own is not None:
            setattr(cls, name, _guarded(own, f"{name} of {cls.name} fails", where))


def _guarded(method: Callable[..., Any], what: str, where: str) -> Callable[..., Any]:
    @functools.wraps(method)
    def call(*args: Any, **named: Any) -> Any:
        with user_code(where, what):
            return method(*args, **named)

    return call


def _without(what: str, where: str) -> Callable[..., Any]:
    """Stand-in for a basis that the class does not define: it raises the message."""

    def basis(*_: Any) -> Any:
        raise InputError(what, where=where, fix="write def basis(self, view, shape) in it")

    return basis


def try_laws(cls: type[Effect], where: str) -> None:
    """Call an effect's basis and shift once on a sample run of every mechanism family that it applies to.

    Args:
        cls: the effect.
        where: its file, for messages.

    Raises:
        InputError: one fails, or gives another shape or precision than it should, or numbers that are not finite.
    """
    if cls.basis is Effect.basis and cls.shift is Effect.shift:
        cls.basis = _without(f"{cls.name} has no basis", where)  # type: ignore[method-assign]  # it may be looked at, not used
        return
    for kind in cls.mechanisms:
        view, effect = sample_view(kind, cls.least_joints), cls()
        out = {"drive": view.joints, "geometry": len(view.mechanism.slots)}.get(cls.stage, 3)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            shape = _first_trial(effect, view, where)
            if cls.basis is not Effect.basis:
                wanted: tuple[int, ...] = (view.rows, out, linear_size(effect, view.joints))
                _require(effect.basis(view, shape), wanted, f"basis of {cls.name}", kind, where)
            if cls.shift is not Effect.shift:
                with user_code(where, f"search of {cls.name} gives no value for each parameter"):
                    theta = flatten(effect, shape, view.joints)
                _require(effect.shift(theta, view), (view.rows, out), f"shift of {cls.name}", kind, where)
                _require(effect.slope(theta, view), (view.rows, out, len(theta)), f"slope of {cls.name}", kind, where)


def _first_trial(effect: Effect, view: View, where: str) -> Mapping[str, torch.Tensor]:
    trials = effect.search(view)
    try:
        return trials[0]
    except (TypeError, IndexError, KeyError):
        what = f"search of {effect.name} offers no trial"
        raise InputError(what, where=where, fix="return at least one") from None


def _require(values: Any, wanted: tuple[int, ...], which: str, kind: str, where: str) -> None:
    if not isinstance(values, torch.Tensor):
        fix = f"return a float64 tensor of shape {wanted}"
        raise InputError(f"{which} is {shown(type(values).__name__)}, no tensor", where=where, fix=fix)
    if tuple(values.shape) != wanted or values.dtype != torch.float64:
        found = f"{str(values.dtype).removeprefix('torch.')} of shape {tuple(values.shape)}"
        what = f"{which} is {found} on a sample {kind}, not float64 of shape {wanted}"
        raise InputError(what, where=where, fix="(rows, outputs of its stage), for a basis (.., .., linear values)")
    largest = float(values.abs().max()) if values.numel() else 0.0
    if not largest < 1e100:
        what = f"{which} holds {largest:g} on a sample {kind}"
        raise InputError(what, where=where, fix="keep it finite for every pose")
