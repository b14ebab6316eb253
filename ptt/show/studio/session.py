"""The state of one page as an immutable value: a run, a model with its undo history, and all results on models."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any, TypeVar

from ptt.errors import ModelError
from ptt.machine import format_machine, parse_machine
from ptt.machine_schema import EffectEntry
from ptt.show.studio.later import LaterAnswer
from ptt.show.studio.looks import Look
from ptt.show.studio.results import Changed, Compared, Diagnosed, Source, Trained
from ptt.show.studio.snapshot import Figures, Rung, Snapshot, parsed
from ptt.show.studio.steps import START, step_command, switch_commands

Value = TypeVar("Value")
# Fields that are ignored where machine files are compared: they say how a model came to be.
_WAY: Mapping[str, Any] = {"history": (), "covariance": None}


@dataclass(frozen=True)
class Session:
    """The state of one page; every change makes a new value. Results are kept by the text of the active model.

    Attributes:
        source: the files that are read; None before there is a run.
        now: the present model; None before there is a machine.
        past: models before it, oldest first.
        future: models that were undone, the next one to redo first.
        looks: model text -> look.
        comparisons: model text -> comparison.
        diagnoses: model text -> diagnosis.
        trainings: model text -> compensator.
        first: date of the run, '2026-03-15', as entered by a person; '' where nobody did.
        later: file and date of later runs of the same machine.
        said: a person's answers on later runs.
    """

    source: Source | None = None
    now: Snapshot | None = None
    past: tuple[Snapshot, ...] = ()
    future: tuple[Snapshot, ...] = ()
    looks: Mapping[str, Look] = field(default_factory=dict)
    comparisons: Mapping[str, Compared] = field(default_factory=dict)
    diagnoses: Mapping[str, Diagnosed] = field(default_factory=dict)
    trainings: Mapping[str, Trained] = field(default_factory=dict)
    first: str = ""
    later: tuple[tuple[str, str], ...] = ()
    said: tuple[LaterAnswer, ...] = ()

    @property
    def ready(self) -> bool:
        """Whether there are a run and a model."""
        return self.source is not None and self.now is not None

    @property
    def text(self) -> str:
        """Text of the active model: the machine.toml without effects that are switched off; '' where there is none."""
        return "" if self.now is None else self.now.active

    @property
    def look(self) -> Look | None:
        """Look of the active model; None while it is not known, as of all results."""
        return self.looks.get(self.text)

    @property
    def comparison(self) -> Compared | None:
        """Comparison of the active model."""
        return self.comparisons.get(self.text)

    @property
    def diagnosis(self) -> Diagnosed | None:
        """Diagnosis of the active model."""
        return self.diagnoses.get(self.text)

    @property
    def diagnosis_of_drawing(self) -> Diagnosed | None:
        """Diagnosis of the bare drawing, if it was made in this session."""
        bare = None if self.now is None else replace(self.now.file, effect=(), **_WAY)
        files = ((parsed(text), found) for text, found in self.diagnoses.items())
        return next((found for file, found in files if replace(file, **_WAY) == bare), None)

    @property
    def error_um(self) -> Figures | None:
        """Rms error with the active model by x, y, z and total, um: from its diagnosis, else from its comparison.

        The two differ a little, as a diagnosis sets rows at the beginning of runs aside and weighs the frame by the
        noise that it has found. The page always shows one of them.
        """
        return self._error_of(self.text)

    @property
    def began_um(self) -> Figures | None:
        """The error, as `error_um`, with the model before the first step; None before any step."""
        return self._error_of(self.past[0].active) if self.past else None

    def _error_of(self, text: str) -> Figures | None:
        if text in self.diagnoses:
            return dict(self.diagnoses[text].data["rms_um"]["before"])
        return dict(self.comparisons[text].data["rms_um"]) if text in self.comparisons else None

    @property
    def training(self) -> Trained | None:
        """Compensator trained on the active model."""
        return self.trainings.get(self.text)

    @property
    def effects(self) -> tuple[EffectEntry, ...]:
        """Effects of the present model, those switched off included."""
        return () if self.now is None else self.now.file.effect

    @property
    def commands(self) -> tuple[str, ...]:
        """Command lines that lead to the active model, with the removal of effects that are switched off."""
        if self.now is None or self.source is None:
            return ()
        return (
            *self.now.commands,
            *switch_commands(self.source, len(self.now.commands), self.now.removed, self.now.off),
        )

    @property
    def kind(self) -> str:
        """Kind of the machine."""
        return "three-ptt" if self.now is None else self.now.file.machine.kind

    def opened(self, source: Source, model: str) -> "Session":
        """A fresh session on a run and a model; nothing of this one is kept."""
        return Session(source=source, now=Snapshot(model))

    def remembering(
        self,
        *,
        text: str | None = None,
        look: Look | None = None,
        compared: Compared | None = None,
        diagnosed: Diagnosed | None = None,
        trained: Trained | None = None,
    ) -> "Session":
        """The session with results on a model added: the active model, unless a text names another."""
        text = self.text if text is None else text
        return replace(
            self,
            looks=_with(self.looks, text, compared.look if compared else look),
            comparisons=_with(self.comparisons, text, compared),
            diagnoses=_with(self.diagnoses, text, diagnosed),
            trainings=_with(self.trainings, text, trained),
        )

    def changed(self, verb: str, effects: tuple[str, ...], change: Changed) -> "Session":
        """The session with the model that adding, removing or refitting has made.

        Args:
            verb: 'add', 'remove' or 'fit'.
            effects: keys of the effects.
            change: the result; effects that are switched off stay in the model, switched off.

        Returns:
            The session.
        """
        assert self.now is not None and self.source is not None
        commands, off = self.commands, self.now.off - set(effects)
        sign = {"add": "+ ", "remove": "\N{MINUS SIGN} ", "fit": ""}[verb]
        steps = tuple(_rung(step) for step in change.data["steps"])
        made = Snapshot(
            _with_off(change.model, self.now),
            off,
            f"{sign}{' '.join(effects) or 'refit'}",
            (*self.now.rungs, *steps[1:]) if self.now.rungs else steps,
            change.data["noise_um"],
            (*commands, step_command(self.source, len(commands), verb, effects)),
            off,
            fit=change.text,
        )
        return self._to(replace(made, fitted=made.active))

    def switched(self, key: str, on: bool) -> "Session":
        """The session with an effect switched on or off; its parameters stay as they are.

        Args:
            key: key of the effect.
            on: whether it is part of the active model.

        Returns:
            The session.

        Raises:
            ModelError: it is not in the model.
        """
        assert self.now is not None
        if key not in (each.key for each in self.effects):
            raise ModelError(f"effect '{key}' is not in the model")
        off = self.now.off - {key} if on else self.now.off | {key}
        return self._to(replace(self.now, off=off, words=f"{key} {'on' if on else 'off'}"))

    def undone(self) -> "Session":
        """The session one step back; unchanged where there is none."""
        if not self.past or self.now is None:
            return self
        return replace(self, now=self.past[-1], past=self.past[:-1], future=(self.now, *self.future))

    def redone(self) -> "Session":
        """The session one step forward again; unchanged where there is none."""
        if not self.future or self.now is None:
            return self
        return replace(self, now=self.future[0], past=(*self.past, self.now), future=self.future[1:])

    def others(self) -> dict[str, Look]:
        """Words on other models of this session -> their looks, to be drawn beside the active one's."""
        if self.now is None:
            return {}
        found: dict[str, Look] = {}
        for snapshot in (*self.past, self.now, *self.future):
            text = snapshot.active
            if text != self.text and text in self.looks:
                keys = self.looks[text].effects
                words = f"model with {', '.join(keys)}" if keys else "model without effects"
                found[words] = self.looks[text]
        return found

    def _to(self, snapshot: Snapshot) -> "Session":
        assert self.now is not None
        return replace(self, now=snapshot, past=(*self.past, self.now), future=())


def _rung(step: Mapping[str, Any]) -> Rung:
    sign = {"added": "+ ", "removed": "\N{MINUS SIGN} "}.get(step["kind"], "")
    return Rung(sign + step["effect"], step["rms_um"], step["heldout_rms_um"], step.get("helped", True))


def _with(known: Mapping[str, Value], text: str, value: Value | None) -> Mapping[str, Value]:
    return known if value is None else {**known, text: value}


def _with_off(text: str, before: Snapshot) -> str:
    """The changed model with the effects that are switched off put back."""
    if not before.off:
        return text
    file, there = parse_machine(text, START), {entry.key for entry in before.file.effect}
    off = tuple(e for e in before.file.effect if e.key in before.off and e.key in there)
    own = {entry.key for entry in file.effect}
    return format_machine(replace(file, effect=(*file.effect, *(e for e in off if e.key not in own))))
