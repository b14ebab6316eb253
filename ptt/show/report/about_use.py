"""Sections of the report on errors before and after compensation, and on the figures of ISO 9283."""

from ptt.judge.aimed import lent_in_words
from ptt.judge.iso.pose_figures import named_figures
from ptt.run.axes import AXES_TOTAL
from ptt.show.report.blocks import Block, Picture, Section, Words, grid
from ptt.show.report.contents import Contents
from ptt.show.report.numbers import NONE, axes, um

TITLES = {  # way of holding out rows -> title of its table
    "blocks": "whole parts of the path held out: what to expect at a new place",
    "random": "poses held out at random: between measured neighbours",
}


def pair_section(contents: Contents) -> Section:
    """The run beside a later one of the same machine."""
    assert contents.pair is not None
    data = contents.pair.to_dict()
    rows = [(key, str(data[key]["rows"]), *axes(data[key]["rms_um"])) for key in ("before", "after")]
    rows.append(("less by", "", *(_less(data["reduction_percent"][axis]) for axis in AXES_TOTAL)))
    title = f"Tool against its targets, RMS in um ({data['frame']})"
    zones = [(zone["where"], um(zone["before_um"]), um(zone["after_um"])) for zone in data["where"]]
    blocks: list[Block] = [
        Words(f"Before: {data['before']['source']}; after: {data['after']['source']}."),
        grid(title, ("", "readings", *AXES_TOTAL), rows),
        Picture("pair", "Error of the tool seen from above, before and after, on one scale."),
        grid("Where, RMS in um", ("part of the workspace", "before", "after"), zones),
    ]
    if data["shared_poses"]:
        left = "; rows without a counterpart: {before} before, {after} after".format(**data["unmatched"])
        share = f"{data['nearer_share']:.0%} of {data['shared_poses']} readings at poses measured in both"
        words = f"{share} are nearer to their targets{left}."
    else:
        words = "No pose was measured in both: totals and parts of the workspace are compared."
    blocks.append(Words(words))
    blocks += [Words(f"{lent}.")] if (lent := lent_in_words(contents.pair.lent)) else []
    if data["worse"]:
        worse = [(one["row"], um(one["before_um"]), um(one["after_um"])) for one in data["worse"]]
        blocks.append(grid("Poses that got worse the most, um", ("row", "before", "after"), worse))
    return Section("pair", "The run beside a later one", tuple(blocks))


def reduction_section(contents: Contents) -> Section:
    """Mean absolute error per axis before and after, on held-out readings."""
    if not contents.evaluation:
        words = f"Not computed: {contents.why_not['evaluate']}."
        return Section("reduction", "Before and after, per axis", (Words(words, "lack"),))
    blocks: list[Block] = []
    for name, result in contents.evaluation.items():
        data = result.to_dict()
        rows = [
            (
                axis,
                um(row["before_um"]),
                um(row["after_um"]),
                _less(row["reduction_percent"]),
                "yes" if data["rest_is_noise"].get(axis) else NONE,
            )
            for axis, row in (*data["axes"].items(), ("length", data["length"]))
        ]
        head = ("mean |error|", "before um", "after um", "less", "left is noise")
        blocks.append(grid(f"{TITLES.get(name, name).capitalize()}", head, rows))
        blocks.append(Words(f"{data['protocol']['rows']} readings; {data['protocol']['held_out']}.", "note"))
    blocks.append(
        Picture("curves", "Error of held-out readings along the path, before and after; their scales differ.")
    )
    blocks.append(
        Words(
            "Computed on readings that neither parameters nor network had seen, not measured again: send corrected "
            "commands to the machine, measure once more and compare both runs with ptt evaluate.",
            "note",
        )
    )
    return Section("reduction", "Before and after, per axis", tuple(blocks))


def iso_section(contents: Contents) -> Section:
    """ISO 9283 figures where poses were repeated, else why there are none."""
    if contents.iso is None:
        words = f"Not computed: {contents.why_not['iso']}."
        return Section("iso", "ISO 9283 figures", (Words(words, "lack"),))
    figures = contents.iso.to_dict()
    after = figures["aligned"]
    cells = [
        (name, *((um(pair["mean"]), um(pair["worst"])) if pair else (NONE, NONE)))
        for name, pair in named_figures(figures)
    ]
    words = (
        f"The machine as it was measured, without the model: {len(after['poses'])} poses measured at least twice the "
        f"same way; {after['single_poses']} measured once are left out."
    )
    cycles = (
        f" The standard requires 30 cycles, but there are {after['cycles']}: its method is followed, its conditions "
        "are not met."
    )
    less = "" if after["standard"].startswith("ISO 9283") else cycles
    table = grid(f"{figures['standard']}, um", ("", "mean", "worst"), cells)
    return Section("iso", "ISO 9283 figures", (Words(words + less), table))


def _less(value: float | None) -> str:
    return NONE if value is None else f"{um(value)} %"
