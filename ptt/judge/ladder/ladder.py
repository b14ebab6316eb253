"""The ladder: the steps of a model, and training and held-out errors after each."""

from dataclasses import dataclass, field
from typing import Any, ClassVar

from ptt.fitting.masked import Masked
from ptt.fitting.report import FitReport
from ptt.fitting.result import FitResult
from ptt.model.model import Model
from ptt.record import Record

CHANCE = 2.0  # standard errors by which the held-out error must fall before it counts as fallen


@dataclass(frozen=True)
class LadderStep:
    """One step of a ladder.

    Attributes:
        effect: what was added or removed; 'as given' and 'refit' before anything was.
        kind: 'given', 'refit', 'added' or 'removed'.
        rms_um: training error, x, y, z, total.
        heldout_rms_um: held-out error, likewise.
        fall: fall of the held-out squared error against the step before, in its own standard errors.
        fitted: the model after the step with its fit.
    """

    effect: str
    kind: str
    rms_um: dict[str, float]
    heldout_rms_um: dict[str, float]
    fall: float
    fitted: FitResult

    @property
    def helped(self) -> bool:
        """Whether the held-out error fell by more than chance (removed: did not rise by more)."""
        return self.fall > -CHANCE if self.kind == "removed" else self.fall > CHANCE

    def to_dict(self) -> dict[str, Any]:
        """For JSON."""
        own = {"effect": self.effect, "kind": self.kind, "rms_um": self.rms_um, "heldout_rms_um": self.heldout_rms_um}
        return own if self.kind == "given" else {**own, "helped": self.helped, "fall_in_standard_errors": self.fall}


@dataclass(frozen=True)
class Ladder(Record):
    """The steps from the model as given on.

    Attributes:
        steps: the model as given first.
        report: of the last fit.
        noise_um: the noise floor, and its source.
        protocol: which rows were held out, in words.
        notes: further remarks for the user.
        ranges: column of load, temperature or feed -> its lowest and highest value in the run.
        masked: masked effects: what the run says of effects that the model does not have.
    """

    keys: ClassVar[str] = (
        "steps, noise_um, rows: report.rows, parameters: report.values, unobservable: report.unobservable, "
        "protocol, stretches: report.stretches, notes, fit: report"
    )

    steps: tuple[LadderStep, ...]
    report: FitReport
    noise_um: dict[str, Any]
    protocol: str
    notes: tuple[str, ...] = ()
    ranges: dict[str, list[float]] = field(default_factory=dict)
    masked: Masked | None = None

    @property
    def model(self) -> Model:
        """The model after the last step."""
        return self.steps[-1].fitted.model
