"""Everything a report says, gathered once as values: the same results that the other verbs give."""

from dataclasses import dataclass
from typing import Any

from ptt.diagnosis.telling.diagnosis import Diagnosis
from ptt.effects.registry import Library
from ptt.judge.before_after import BeforeAfter
from ptt.judge.compare.comparison import Comparison
from ptt.judge.evaluation import Evaluation
from ptt.judge.history import HistoryEntry
from ptt.judge.iso.figures import IsoPoses
from ptt.judge.ladder.ladder import Ladder
from ptt.machine import MachineFile
from ptt.model.model import Model
from ptt.plan.elsewhere import elsewhere_um
from ptt.run.problem import Problem
from ptt.run.taken import set_up
from ptt.show.report.commands import Command
from ptt.show.report.facts import RunFacts
from ptt.show.report.network import NetworkFacts
from ptt.show.report.source import MadeOf


@dataclass(frozen=True)
class ModelLook:
    """A run held against one model.

    Attributes:
        model: the model.
        comparison: how large the error is, where, and what it depends on.
        diagnosis: what is missing; None where nothing tells the noise.
        why_not: why there is no diagnosis, '' where there is one.
    """

    model: Model
    comparison: Comparison
    diagnosis: Diagnosis | None
    why_not: str = ""


@dataclass(frozen=True)
class Contents:
    """All that a report says.

    Attributes:
        date: ISO 8601, UTC.
        source: files, names and options.
        facts: what was understood of the run.
        problem: the run, seen through the machine.
        known: effects by name, the user's own included.
        drawing: the run against the bare drawing.
        given: the run against the model; the same as `drawing` where the model has no effects.
        ladders: steps that led to the model, one tuple for each ladder, from its history.
        refit: the model's effects fitted to this run; None where that cannot be done.
        evaluation: protocol -> mean absolute errors before and after on held-out rows; empty where there is no after.
        network: what a compensator's network does; None without one.
        iso: ISO 9283 figures; None where no pose was repeated.
        why_not: 'fit', 'evaluate', 'iso', 'history' -> why it is not there.
        versions: name and version of what worked it out.
        commands: what repeats it, and what each of them tells.
        pair: the run beside a later one of the same machine; None where none was given.
    """

    date: str
    source: MadeOf
    facts: RunFacts
    problem: Problem
    known: Library
    drawing: ModelLook
    given: ModelLook
    ladders: tuple[tuple[HistoryEntry, ...], ...]
    refit: Ladder | None
    evaluation: dict[str, Evaluation]
    network: NetworkFacts | None
    iso: IsoPoses | None
    why_not: dict[str, str]
    versions: tuple[tuple[str, str], ...]
    commands: tuple[Command, ...]
    pair: BeforeAfter | None = None

    @property
    def file(self) -> MachineFile:
        """The machine and its model."""
        return self.given.model.file

    @property
    def bare(self) -> bool:
        """Whether the model is the drawing alone."""
        return self.given is self.drawing

    def to_dict(self) -> dict[str, Any]:
        """For JSON; what other verbs tell too is in their own words."""
        looks = {"drawing": self.drawing, "model": self.given}
        beside = {name: set_up(self.problem) | _aside(look) for name, look in looks.items()}
        return {
            "date": self.date,
            "files": [file.to_dict() for file in self.source.files],
            "run": self.facts.to_dict(),
            "compare": {name: look.comparison.to_dict() | beside[name] for name, look in looks.items()},
            "diagnose": {
                name: look.diagnosis and look.diagnosis.to_dict() | beside[name] for name, look in looks.items()
            },
            "history": [[dict(vars(entry)) for entry in ladder] for ladder in self.ladders],
            "fit": None if self.refit is None else self._figures_of(self.refit) | beside["model"],
            "evaluate": {name: result.to_dict() for name, result in self.evaluation.items()},
            "network": None if self.network is None else self.network.to_dict(),
            "iso": None if self.iso is None else self.iso.to_dict(),
            "why_not": self.why_not,
            "versions": dict(self.versions),
            "commands": [command.line for command in self.commands],
            **({} if self.pair is None else {"before_after": self.pair.to_dict()}),
        }

    def _figures_of(self, refit: Ladder) -> dict[str, Any]:
        return refit.to_dict() | elsewhere_um(refit.steps[-1].fitted, self.problem)


def _aside(look: ModelLook) -> dict[str, list[str]]:
    """Effects of other runs, as the verbs tell them."""
    return {"other_runs": [term.effect.key for term in look.model.aside]}
