"""Sections of the report on the model: the ladder that led to it, its parameters, its network."""

from collections.abc import Iterator, Sequence

from ptt.fitting.report import Value
from ptt.judge.compare.rows import percent
from ptt.judge.history import HistoryEntry
from ptt.model.model import Term, parameter_names, told_values
from ptt.run.axes import AXES_TOTAL
from ptt.show.plots.ladder import SIGNS
from ptt.show.report.blocks import Block, Grid, Lines, Picture, Section, Words, grid
from ptt.show.report.commands import ladder_command
from ptt.show.report.contents import Contents
from ptt.show.report.network import NetworkFacts
from ptt.show.report.numbers import NONE, axes, plus_minus, um

MEASURED = {  # `measured` of a fitted value -> what the table says
    "yes": "yes",
    "in part": "in part: only combinations with others are",
    "at least": "lower bound: no move of the run takes up a larger one",
    "no": "no: held by its usual size",
    "fixed": "fixed by the user",
    "searched": "searched, not fitted",
}
AGAINST = "against the mean of all joints, which is not"  # said of a value of which only that difference is measured
MOST_PAIRS = 10  # correlations that are listed


def ladder_section(contents: Contents) -> Section:
    """The steps that led to the model, from its history."""
    blocks: list[Block] = []
    if "history" in contents.why_not:
        blocks.append(Words(f"No ladder: {contents.why_not['history']}.", "lack"))
    elif not contents.ladders:
        words = "The model has no history: this program has not added, removed or refitted anything."
        blocks.append(Words(words, "lack"))
    for number, ladder in enumerate(contents.ladders):
        files = ", ".join(f"{item['file']} (SHA-256 {item['sha256'][:12]}...)" for item in ladder[0].files)
        blocks += [
            Words(f"{ladder[0].date[:10]}, from {files or 'unnamed files'}, {ladder[0].rows} readings:"),
            Lines((ladder_command(ladder),), code=True),
            Picture(
                f"ladder-{number}", "Error after each step, on the readings it was fitted to and on held-out ones."
            ),
            _ladder_grid(ladder),
        ]
    return Section("ladder", "The ladder: how the error fell", tuple(blocks))


def parameter_section(contents: Contents) -> Section:
    """Parameters with standard errors in the model and fitted to this run, and what this run does not determine."""
    rows = list(_parameters(contents))
    head = ("parameter", "unit", "in the model", "fitted to this run", "measured by this run")
    strong = frozenset(index for index, row in enumerate(rows) if not any(row[1:]))
    title = "Parameters with one standard error"
    blocks: list[Block] = [grid(title, head, rows, left=2, wordy=True, strong=strong)]
    if contents.refit is None:
        blocks.append(Words(f"Not fitted to this run: {contents.why_not.get('fit', '')}.", "lack"))
        return Section("parameters", "Parameters of the model", tuple(blocks))
    report = contents.refit.report
    blocks.append(
        Words(
            f"The fit {report.status}: {report.rows} readings, {report.unknowns} unknowns with the frame, of which the "
            f"data see {report.rank}; chi-squared per degree of freedom {report.reduced:.3f}.",
        )
    )
    blocks += [Words(f"{note}.") for note in contents.refit.notes]
    if report.unobservable:
        blocks += [Words("What this run cannot determine:"), Lines(tuple(item.text for item in report.unobservable))]
    else:
        blocks.append(Words("Every parameter that was fitted is measured by this run."))
    if report.correlations:
        pairs = [(one.first, one.second, f"{one.value:+.3f}") for one in report.correlations[:MOST_PAIRS]]
        title = f"Parameters that the run hardly separates: correlations above 0.9, {len(report.correlations)} in all"
        blocks.append(grid(title, ("one", "other", "correlation"), pairs, left=2))
    return Section("parameters", "Parameters of the model", tuple(blocks))


def network_section(contents: Contents) -> Section:
    """What the network learned of the error that physics left, and how much of it."""
    facts = contents.network
    if facts is None:
        words = "No compensator was given: this report covers the physics alone."
        return Section("network", "The network's share", (Words(words, "lack"),))
    learned = ", ".join(facts.learned)
    words = f"{facts.nodes} Gaussians, for {learned}." if learned else "Nothing was left that the network could learn."
    removed = f"It removed {percent(facts.share)} of the held-out variance that the physics left."
    blocks = (
        Words(f"{words} {removed} {_origin(facts)}"),
        grid("Held-out error when it was trained, RMS in um", ("", *AXES_TOTAL), _stages(facts)),
        Words(
            f"Held out: {facts.protocol}. {facts.inside} of {facts.readings} readings of this run lie in its training "
            f"domain, where its largest correction is {um(facts.largest_um)} um. Outside the domain it "
            "changes nothing.",
        ),
    )
    return Section("network", "The network's share", blocks)


def _origin(facts: NetworkFacts) -> str:
    files = ", ".join(facts.trained_on)
    same = {True: ", which this report is about", False: ", another run than this one", None: ""}[facts.this_run]
    return f"Trained on {files}{same}."


def _stages(facts: NetworkFacts) -> list[tuple[str, ...]]:
    words = {"given": "model as given, nothing held out", "physics": "physics refitted", "rbf": "physics and network"}
    return [(words.get(stage, stage), *axes(figures)) for stage, figures in facts.heldout_rms_um.items()]


def _ladder_grid(ladder: Sequence[HistoryEntry]) -> Grid:
    first, last = ladder[0], ladder[-1]
    rows = [("as given", *axes(first.before_um), *axes(first.heldout_before_um), NONE)]
    rows += [
        (
            f"{SIGNS.get(entry.kind, '')}{entry.effect}",
            *axes(entry.after_um),
            *axes(entry.heldout_after_um),
            "yes" if entry.helped else "no",
        )
        for entry in ladder
    ]
    noise = axes(last.noise_um)
    rows.append((f"noise ({last.noise_um['source']})", *noise, *noise, NONE))
    head = ("step", *AXES_TOTAL, *(f"held out {axis}" for axis in AXES_TOTAL), "helped")
    return grid("Error after each step, RMS in um", head, rows)


def _parameters(contents: Contents) -> Iterator[tuple[str, ...]]:
    """Rows of the table of parameters: one for each effect, then one for each of its parameters."""
    found: dict[tuple[str, str], Value] = {}
    if contents.refit is not None:
        found = {(value.effect, value.name): value for value in contents.refit.report.values}
    for term in contents.given.model.terms:
        yield term.effect.key, "", "", "", ""
        told = told_values(term.effect, term.theta, contents.given.model.joints)
        for index, (name, unit) in enumerate(_names(term, contents)):
            if not told[index]:
                continue
            fitted, word = _fitted(found.get((term.effect.key, name)))
            yield name, unit, _stored(term, index), fitted, word


def _fitted(value: Value | None) -> tuple[str, str]:
    """A value as fitted to the run, and whether the run measures it, in words."""
    if value is None:
        return NONE, NONE
    if value.apart is not None and value.measured != "at least":
        return plus_minus(value.value, value.apart), AGAINST
    return NONE if value.measured == "no" else plus_minus(value.value, value.std), MEASURED[value.measured]


def _names(term: Term, contents: Contents) -> list[tuple[str, str]]:
    kind, joints = contents.file.machine.kind, contents.given.model.joints
    units = [p.on(kind).unit for p in term.effect.parameters for _ in range(p.size(joints))]
    return list(zip(parameter_names(term.effect, kind, joints), units, strict=True))


def _stored(term: Term, index: int) -> str:
    """A value as the model has it."""
    if not len(term.theta):
        return "not fitted yet"
    return plus_minus(float(term.theta[index]), None if term.std is None else float(term.std[index]))
