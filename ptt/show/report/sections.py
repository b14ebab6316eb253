"""The sections of a report, in order."""

from ptt.effects.phrases import capital
from ptt.judge.compare.rows import percent
from ptt.run.axes import AXES_TOTAL
from ptt.run.noise import source_in_words
from ptt.show.report.about_error import error_section, left_section
from ptt.show.report.about_model import ladder_section, network_section, parameter_section
from ptt.show.report.about_run import origin_section, run_section
from ptt.show.report.about_use import iso_section, pair_section, reduction_section
from ptt.show.report.about_verdict import in_short, verdict_section
from ptt.show.report.blocks import Block, Section, Words, grid
from ptt.show.report.contents import Contents
from ptt.show.report.numbers import axes


def sections_of(contents: Contents) -> tuple[Section, ...]:
    """All sections of a report.

    Args:
        contents: contents of the report.

    Returns:
        The sections in order.
    """
    return (
        summary_section(contents),
        run_section(contents),
        error_section(contents),
        verdict_section(contents),
        ladder_section(contents),
        *(() if contents.bare else (parameter_section(contents), left_section(contents))),
        network_section(contents),
        reduction_section(contents),
        *(() if contents.pair is None else (pair_section(contents),)),
        iso_section(contents),
        origin_section(contents),
    )


def summary_section(contents: Contents) -> Section:
    """The verdict, and a table of the errors before and after with the noise floor."""
    drawn = contents.drawing.comparison.to_dict()
    rows = [("machine as drawn, after frame alignment", *axes(drawn["rms_um"]))]
    if not contents.bare:
        rows.append(("with the model, all readings", *axes(contents.given.comparison.to_dict()["rms_um"])))
        if contents.refit is not None:
            held = contents.refit.steps[-1].heldout_rms_um
            rows.append(("with the model, on held-out readings", *axes(held)))
    noise = contents.given.comparison.noise
    if noise is not None:
        figures = noise.to_dict()
        rows.append((f"noise floor, from {source_in_words(figures['source'])}", *axes(figures)))
    blocks: list[Block] = [Words(_verdict(contents), "verdict"), grid("Error, RMS in um", ("", *AXES_TOTAL), rows)]
    return Section("summary", "In short", tuple(blocks))


def _verdict(contents: Contents) -> str:
    found, drawn = contents.given.diagnosis, contents.drawing.diagnosis
    if found is None:
        return f"No verdict: {contents.given.why_not}."
    if contents.bare:
        return capital(in_short(found))
    effects = ", ".join(contents.given.model.keys)
    before = contents.drawing.comparison.to_dict()["rms_um"]["total"]
    after = contents.given.comparison.to_dict()["rms_um"]["total"]
    fall = f"does not reduce the error: {before:.1f} um RMS without it, {after:.1f} um with it"
    if after < before:
        gained = percent(1.0 - after / before)
        fall = f"reduces the error from {before:.1f} to {after:.1f} um RMS ({gained} less)"
    tail = "" if drawn is None or drawn.verdict != "unknown" else " For the bare drawing no full explanation was found."
    return f"The model ({effects}) {fall}. {found.words}{tail}"
