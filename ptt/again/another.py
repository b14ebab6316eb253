"""Whether a run may be of another machine than the one that a model was fitted to: nearly everything is otherwise."""

from collections.abc import Mapping, Sequence, Set

from ptt.again.explanation import Explanation
from ptt.again.figures import TOTAL, clear_values
from ptt.again.result import ChangedValue

OTHERWISE = 3  # effects, or values, that are otherwise at least: a repair is of one or two

Names = Mapping[str, Set[str]]  # effect -> names of its values


def is_another(
    found: Explanation, changed: Sequence[ChangedValue], before: Mapping[str, float], new: int, noise: float
) -> bool:
    """Whether so much is otherwise at once that the run may be of another machine.

    Args:
        found: the best explanation of the run.
        changed: values that have changed.
        before: tool error that each effect of the model would cause in this run, um.
        new: number of effects that the model does not have.
        noise: of this run, um.

    Returns:
        Whether effects say so, or values.
    """
    names = dict[str, set[str]]()
    for item in changed:
        names.setdefault(item.moved.effect, set()).add(item.moved.name)
    if looks_like_another(before, names.keys(), new, noise):
        return True
    cured = all(item.repaired for item in changed)
    return not cured and values_say_another(_shown(before, noise), names, clear_values(found))


def looks_like_another(before: Mapping[str, float], changed: Set[str], new: int, noise: float) -> bool:
    """Whether most effects that would show have changed, two at least, and three things or more are otherwise.

    Args:
        before: tool error that each effect of the model would cause in this run, um.
        changed: effects of which values have changed.
        new: number of effects that the model does not have.
        noise: of this run, um.
    """
    shown = _shown(before, noise)
    return len(changed) > 1 and 2 * len(changed & shown) > len(shown) and len(changed) + new >= OTHERWISE


def values_say_another(shown: Set[str], changed: Names, clear: Names) -> bool:
    """Whether of each effect that would show, two at least, most values have changed that are clearly not zero.

    A model of two effects never has three that changed. Wear and repairs are of one effect, or of one joint.

    Args:
        shown: effects that would show in the run.
        changed: of each effect, the values that have changed.
        clear: of each effect, those that were clearly not zero in the model.

    Returns:
        Whether they have, and three values or more.
    """
    other = [changed.get(key, frozenset()) for key in shown]
    every = [set(changed.get(key, ())) | set(clear.get(key, ())) for key in shown]
    most = all(2 * len(own) > len(all_) for own, all_ in zip(other, every, strict=True))
    return len(shown) > 1 and most and sum(map(len, other)) >= OTHERWISE


def _shown(before: Mapping[str, float], noise: float) -> set[str]:
    return {key for key, size in before.items() if key != TOTAL and size > noise}
