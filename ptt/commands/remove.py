"""`ptt remove`: take effects out of a model, refit, and show whether the error rises."""

from ptt.commands.add import EffectNames, Out, Plots
from ptt.commands.common import Also, Anyway, Effects, Json, Map, ModelPath, ReadOptions, Run, Set, Targets


def remove(
    run: Run,
    effect: EffectNames,
    model: ModelPath,
    out: Out,
    also: Also = None,
    targets: Targets = None,
    set_: Set = None,
    map_: Map = None,
    effects: Effects = None,
    plots: Plots = None,
    anyway: Anyway = False,
    json: Json = False,
) -> None:
    """Take effects out of a model, refit the others jointly, and show what that does to the error."""
    from ptt.commands.add import finish
    from ptt.commands.common import load_both, note, progress
    from ptt.door import changing

    loaded, rows = load_both(run, model, ReadOptions(also, targets, set_, map_, effects, json, anyway))
    with progress() as tell:
        result = changing.remove(loaded, rows, *effect, anyway=anyway, progress=tell, note=note)
    finish(result, out, plots, json)
