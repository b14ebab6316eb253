"""`ptt recheck`: has the machine changed since its model was fitted?"""

from ptt.commands.common import Also, Anyway, Effects, Json, Map, ModelPath, Reading, Run, Set, Targets


def recheck(
    run: Run,
    model: ModelPath,
    also: Also = None,
    targets: Targets = None,
    set_: Set = None,
    map_: Map = None,
    effects: Effects = None,
    anyway: Anyway = False,
    json: Json = False,
) -> None:
    """Hold a new run against a solved model: the same, what has changed, or what is new."""
    from ptt.commands.common import note, open_run, progress, show
    from ptt.recheck.recheck import recheck as hold_against

    opened = open_run(run, model, Reading(also, targets, set_, map_, effects, json, anyway))
    if opened.compensator.network is not None:
        note("the compensator's network is left aside: the physics alone is held against the run")
    with progress() as tell:
        result = hold_against(opened.model, opened.problem, opened.library, progress=lambda what: tell(what, 0, 0))
    show(result.to_dict() | opened.set_up, str(result), json)
