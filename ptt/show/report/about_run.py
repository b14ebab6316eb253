"""Sections of the report on the run, and on files, versions and commands that reproduce the report."""

from ptt.machine import MachineFile
from ptt.run.axes import AXES_TOTAL
from ptt.run.noise import source_in_words
from ptt.show.report.blocks import Block, Lines, Section, Words, grid, side_by_side
from ptt.show.report.contents import Contents
from ptt.show.report.facts import RunFacts
from ptt.show.report.numbers import axes, um

SHOWN_RUNS = 20  # that are listed by name


def run_section(contents: Contents) -> Section:
    """Rows, runs, columns, units, what varied, the noise and its source."""
    facts = contents.facts
    blocks: list[Block] = [
        grid("Machine and readings", ("", ""), [("machine", _drawing(contents.file)), *_counts(facts)], wordy=True),
        grid(
            "What may matter besides the pose",
            ("variable", "values", "effects of it"),
            [(one.name, one.values, "can be tested" if one.varies else "cannot be tested") for one in facts.covariates],
            left=3,
        ),
        *_noise(contents),
        grid(
            f"Columns{'' if len(facts.runs) == 1 else ' of the first file'}, as understood",
            ("column", "taken for", "unit") * 2,
            side_by_side([(one.title, one.meaning, one.unit) for one in facts.columns]),
            left=6,
        ),
    ]
    if facts.ignored:
        blocks.append(Words(f"Columns that were not used: {', '.join(facts.ignored)}."))
    blocks.append(Lines(facts.lines))
    return Section("data", "What was measured", tuple(blocks))


def origin_section(contents: Contents) -> Section:
    """Files with their hashes, versions of packages, and the commands that reproduce the report."""
    files = [(file.role, file.name, file.sha256) for file in contents.source.files]
    blocks: list[Block] = [
        grid("Input files", ("as", "file", "SHA-256"), files, left=3, code=True)
        if files
        else Words("The readings did not come from files that could be named.", "lack"),
        Words(f"Computed with {', '.join(f'{name} {number}' for name, number in contents.versions)}."),
        Words("These commands give the same figures, in a folder that holds the input files:"),
        Lines(tuple(f"{command.line}\n    # {command.tells}" for command in contents.commands), code=True),
    ]
    return Section("origin", "How to repeat this", tuple(blocks))


def _drawing(file: MachineFile) -> str:
    """Mechanism, dimensions and tracker frame of the machine, in one line."""
    spec, frame = file.machine, f"tracker frame {file.tracker.frame}"
    corrected = f"; the controller compensates {', '.join(file.controller.compensates)}" * bool(
        file.controller.compensates
    )
    if spec.kind == "serial":
        return f"{spec.name}: serial arm, {len(spec.joint)} joints, {spec.convention} parameters; {frame}{corrected}"
    lead = "" if spec.screw_lead_mm is None else f", screw lead {spec.screw_lead_mm:g}"
    return (
        f"{spec.name}: 3-PTT, sliders {spec.sliders} the platform, base radius {spec.base_radius_mm:g}, platform "
        f"radius {spec.platform_radius_mm:g}, links {spec.link_length_mm:g}{lead} mm; {frame}{corrected}"
    )


def _counts(facts: RunFacts) -> list[tuple[str, str]]:
    roles = ", ".join(f"{count} {role}" for role, count in facts.roles.items() if count)
    spans = (f"{axis} {um(low)} to {um(high)}" for axis, low, high in zip("xyz", facts.low, facts.high, strict=True))
    runs = [f"{label or 'one run'} ({rows} rows)" for label, rows in facts.runs]
    more = f" and {len(runs) - SHOWN_RUNS} more" if len(runs) > SHOWN_RUNS else ""
    return [
        ("rows", f"{facts.rows} ({roles}), {facts.observed} of them with a complete reading"),
        ("runs", ", ".join(runs[:SHOWN_RUNS]) + more),
        ("poses", f"{facts.poses} different targets, {facts.repeats} readings that repeat another one"),
        ("volume", f"{', '.join(spans)} mm"),
    ]


def _noise(contents: Contents) -> list[Block]:
    noise, found = contents.given.comparison.noise, contents.given.diagnosis
    if noise is None:
        return [Words(f"The noise floor is unknown: {contents.given.why_not}.", "lack")]
    figures = noise.to_dict()
    row = (f"from {source_in_words(figures['source'])}", *axes(figures))
    blocks: list[Block] = [grid("Noise floor: one standard deviation of a reading, um", ("", *AXES_TOTAL), [row])]
    if found is not None and found.wander is not None:
        size = 1e3 * found.wander.size * found.noise.total
        blocks.append(Words(f"The readings wander by {size:.1f} um {found.wander.lasts}."))
    return blocks
