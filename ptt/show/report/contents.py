"""Contents of a report as values: the results that the other verbs give."""

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
    """A run compared with one model.

    Attributes:
        model: the model.
        comparison: how large the error is, where, and what it depends on.
        diagnosis: what is missing; None where it cannot be made.
        why_not: why there is no diagnosis; '' where there is one.
    """

    model: Model
    comparison: Comparison
    diagnosis: Diagnosis | None
    why_not: str = ""


@dataclass(frozen=True)
class Contents:
    """The contents of a report.

    Attributes:
        date: when it was made, ISO 8601, UTC.
        source: files, names and options that it was made from.
        facts: what was understood of the run.
        problem: the run and its machine.
        known: effects by name, the user's own included.
        drawing: the run compared with the bare drawing.
        given: the run compared with the model; the same object as `drawing` where the model has no effects.
        ladders: the steps that led to the model, one tuple for each ladder in its history.
        refit: the model's effects fitted to this run; None where that cannot be done.
        evaluation: way of holding out ('blocks', 'random') -> mean absolute errors before and after on held-out rows;
            empty where the model has neither effects nor network.
        network: what a compensator's network does; None without one.
        iso: ISO 9283 figures; None where no pose was repeated.
        why_not: 'fit', 'evaluate', 'iso', 'history' -> why it is missing.
        versions: names and versions of the program and its packages.
        commands: commands that reproduce the report.
        pair: the run compared with a later one of the same machine; None where none was given.
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
        """The machine file with its model."""
        return self.given.model.file

    @property
    def bare(self) -> bool:
        """Whether the model has no effects, so that it is the bare drawing."""
        return self.given is self.drawing

    def to_dict(self) -> dict[str, Any]:
        """For JSON; results of other verbs have their keys."""
        looks = {"drawing": self.drawing, "model": self.given}
        fit, beside = self.refit, {name: set_up(self.problem) | _aside(look) for name, look in looks.items()}
        return {
            "date": self.date,
            "files": [file.to_dict() for file in self.source.files],
            "run": self.facts.to_dict(),
            "compare": {name: look.comparison.to_dict() | beside[name] for name, look in looks.items()},
            "diagnose": {
                name: look.diagnosis and look.diagnosis.to_dict() | beside[name] for name, look in looks.items()
            },
            "history": [[dict(vars(entry)) for entry in ladder] for ladder in self.ladders],
            "fit": fit and fit.to_dict() | elsewhere_um(fit.steps[-1].fitted, self.problem) | beside["model"],
            "evaluate": {name: result.to_dict() for name, result in self.evaluation.items()},
            "network": None if self.network is None else self.network.to_dict(),
            "iso": None if self.iso is None else self.iso.to_dict(),
            "why_not": self.why_not,
            "versions": dict(self.versions),
            "commands": [command.line for command in self.commands],
            **({} if self.pair is None else {"before_after": self.pair.to_dict()}),
        }


def _aside(look: ModelLook) -> dict[str, list[str]]:
    """Keys of the model's effects that belong to other runs, as the verbs report them."""
    return {"other_runs": [term.effect.key for term in look.model.aside]}
