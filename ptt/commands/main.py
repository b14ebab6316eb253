"""`ptt`: finds verbs by their files, and turns every error into one line and an exit code."""

import atexit
import difflib
import gc
import importlib
import importlib.util
import os
import sys
import traceback
import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from typing import Annotated, Any, NoReturn

import typer
from typer.core import TyperGroup

from ptt.commands.output import say_aside, show, tell_notes
from ptt.commands.outputs import checked
from ptt.errors import InputError, PttError, shown
from ptt.files import FULL
from ptt.threads import one_thread, set_threads

VERBS = (
    "check", "compare", "diagnose", "add", "remove", "fit", "predict", "evaluate", "simulate", "backlash", "iso",
    "recheck", "export", "program", "plan", "challenge", "dexterity", "effects", "report", "studio", "fleet",
)  # fmt: skip
UNLISTED = ("train",)  # train.py has a program of its own; `run` and `ptt train` do the same
PROGRAM = "ptt"
INTERRUPTED = 130  # as shells say it of a program that was ended by Ctrl-C
COUNTED = {"_duckdb"}  # modules that report leaked objects unless these are collected when the process ends
MESSAGE = 580  # characters of an error, at most
HELP = "Finds out why a 3-PTT parallel robot misses its target, names the missing physics, and corrects it."


class Verbs(TyperGroup):
    """The verbs whose file is there, each loaded when it is asked for."""

    def list_commands(self, ctx: Any) -> list[str]:
        """Names of the verbs, in the order of a session."""
        return [verb for verb in VERBS if importlib.util.find_spec(f"ptt.commands.{verb}")]

    def get_command(self, ctx: Any, cmd_name: str) -> Any:
        """Build a verb from its file; None where there is none."""
        return _build(cmd_name) if cmd_name in (*self.list_commands(ctx), *UNLISTED) else None

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:
        """Find the verb on the command line, or suggest one."""
        if not args[0].startswith("-") and args[0] not in (*self.list_commands(ctx), *UNLISTED):
            near = difflib.get_close_matches(args[0], self.list_commands(ctx), n=1)
            fix = f"did you mean '{near[0]}'?" if near else "`ptt --help` lists the commands"
            raise InputError(f"no command '{args[0]}'", fix=fix)
        return super().resolve_command(ctx, args)

    def invoke(self, ctx: Any) -> Any:
        """Run the verb, on one thread, whatever the process that it runs in has loaded."""
        with one_thread():
            return super().invoke(ctx)

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Read the words; `--version`, with `--json` where wanted, is all there is to say."""
        if "--version" in args and set(args) <= {"--version", "--json"}:
            from ptt.version import text_of, versions

            show(versions(), text_of(versions()), "--json" in args)
            ctx.exit()
        return super().parse_args(ctx, args)

    def main(
        self,
        args: Sequence[str] | None = None,
        prog_name: str | None = None,
        complete_var: str | None = None,
        standalone_mode: bool = True,
        windows_expand_args: bool = True,
        **extra: Any,
    ) -> Any:
        """Run, and end with the exit code that the outcome calls for."""

        def run() -> Any:
            return TyperGroup.main(self, args, prog_name, complete_var, False, windows_expand_args, **extra)

        return _end(guard(run)) if standalone_mode else run()


app = typer.Typer(
    cls=Verbs, help=HELP, add_completion=False, rich_markup_mode=None, context_settings={"max_content_width": 120}
)


@app.callback()
def _root(
    version: Annotated[
        bool, typer.Option("--version", help="Versions of ptt and its main dependencies; as JSON with --json.")
    ] = False,
) -> None:
    pass


def main() -> None:
    """Entry point of `ptt`."""
    set_threads()
    atexit.register(_spare_the_end)
    app(prog_name=PROGRAM)


def run(argv: Sequence[str]) -> int:
    """Run one verb, `train` included, in this process, and print as the command does.

    Args:
        argv: the words after `ptt`, as in ['compare', 'run.csv', '--model', 'machine.toml'].

    Returns:
        The exit code of the command; the process goes on, whatever happens.
    """
    if isinstance(argv, str | bytes):
        return _fail("run takes a list of words, as in run(['compare', 'run.csv', '--model', 'machine.toml'])", 2)
    words = [os.fspath(word) for word in argv]
    return guard(lambda: typer.main.get_command(app).main(args=words, prog_name=PROGRAM, standalone_mode=False))


def run_alone(verb: str, args: Sequence[str] | None = None) -> None:
    """Run one verb as a program of its own, as train.py does.

    Args:
        verb: name of its file in ptt/commands.
        args: arguments; None for those of the command line.
    """
    set_threads()
    atexit.register(_spare_the_end)
    command = _build(verb)
    _end(guard(lambda: command.main(args=None if args is None else list(args), standalone_mode=False)))


def guard(action: Callable[[], Any]) -> int:
    """Run something, and print its error, if any, as one line on standard error.

    Args:
        action: what to run.

    Returns:
        The exit code: 0 done, 2 bad input, 3 data or poses that cannot work, 130 interrupted, 1 anything else.
    """
    try:
        with _quiet():
            code = action()
    except PttError as error:
        return _fail(str(error), error.exit_code)
    except OSError as error:
        return _fail(f"{error.filename or 'file'}: {error.strerror or error}", 1 if error.errno in FULL else 2)
    except MemoryError:
        return _fail("not enough memory; cut the run into parts, or see `ptt diagnose --help` for --chunk-rows", 1)
    except (typer.Abort, KeyboardInterrupt):
        return _fail("interrupted", INTERRUPTED)
    except SystemExit as end:
        return _ended(end.code)
    except Exception as error:
        if hasattr(error, "format_message"):  # an error of the command line itself, of typer's own family
            return _fail(_usage(error), 2)
        if os.environ.get("PTT_TRACEBACK"):
            traceback.print_exc()
        return _fail(f"unexpected {type(error).__name__}: {error}; PTT_TRACEBACK=1 shows where", 1)
    if code == INTERRUPTED:  # typer turns Ctrl-C in a verb into this code
        return _fail("interrupted", code)
    tell_notes()
    return code if isinstance(code, int) else 0


def _ended(code: Any) -> int:
    """The exit code of something that would have ended the process."""
    tell_notes()
    if isinstance(code, str):
        return _fail(code, 1)
    return code if isinstance(code, int) else 0


def _build(verb: str) -> Any:
    module = importlib.import_module(f"ptt.commands.{verb}")
    if hasattr(module, "app"):
        for each in module.app.registered_commands:
            each.callback = checked(each.callback)
        return typer.main.get_command(module.app)
    alone = typer.Typer(add_completion=False, rich_markup_mode=None)
    alone.command(verb)(checked(getattr(module, verb)))
    return typer.main.get_command(alone)


def _usage(error: Any) -> str:
    context = getattr(error, "ctx", None)
    message = " ".join(error.format_message().split()).rstrip(".")
    return message if context is None else f"{message}; see {context.command_path} --help"


def _fail(message: str, code: int) -> int:
    tell_notes(keep=False)
    say_aside(f"error: {shown(' '.join(message.split()), MESSAGE)}")
    return code


@contextmanager
def _quiet() -> Iterator[None]:
    """Hide warnings of libraries, which the user cannot act on, unless warnings were asked for."""
    with warnings.catch_warnings():
        if not sys.warnoptions and not any(action == "error" and not text for action, text, *_ in warnings.filters):
            warnings.simplefilter("ignore")
        yield


def _spare_the_end() -> None:
    """Freeze the garbage collector: its last passes over all objects of torch and pandas would only take time."""
    if not COUNTED & sys.modules.keys():
        gc.freeze()


def _end(code: int) -> NoReturn:
    """End the process with a code; output is flushed here, so that a closed one cannot change it."""
    for stream in (sys.stdout, sys.stderr):
        try:
            if stream is not None:
                stream.flush()
        except (OSError, ValueError):
            code = code or 1
            with suppress(OSError, ValueError):
                os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())
    sys.exit(code)


if __name__ == "__main__":
    main()
