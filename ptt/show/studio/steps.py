"""The steps of a session as command lines: each reads the model that the one before wrote."""

import shlex
from collections.abc import Collection, Sequence

from ptt.show.studio.results import Source

START = "machine.toml"
REFITS = "# a switch on the page leaves the parameters as they are; ptt remove and ptt add refit the model"


def step_command(source: Source, before: int, verb: str, effects: Sequence[str]) -> str:
    """A step as a command line.

    Args:
        source: the files.
        before: number of steps before it.
        verb: 'add', 'remove' or 'fit'.
        effects: keys of the effects.

    Returns:
        The command.
    """
    given = f"model{before}.toml" if before else START
    words = [source.run, *effects, "--model", given, *source.options, "--out", f"model{before + 1}.toml"]
    return shlex.join(["ptt", verb, *words])


def switch_commands(source: Source, before: int, removed: Collection[str], off: Collection[str]) -> tuple[str, ...]:
    """Command lines for what was switched on the page.

    Args:
        source: the files.
        before: number of steps before them.
        removed: keys of effects that those steps have removed because they were switched off.
        off: keys of effects that are switched off now.

    Returns:
        One that removes what was switched off since, and one that adds what was switched on again, if needed.
    """
    turned = [("remove", sorted(set(off) - set(removed))), ("add", sorted(set(removed) - set(off)))]
    steps = [(verb, effects) for verb, effects in turned if effects]
    return tuple(step_command(source, before + number, *step) for number, step in enumerate(steps))
