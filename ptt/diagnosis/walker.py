"""Walker: fits and screens models of one problem, one step at a time."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from ptt.diagnosis.design import Design, build_design, present_candidates
from ptt.diagnosis.screen import Finding, Screen, screen
from ptt.diagnosis.wander import Wander, take_off
from ptt.effects import Effect, Library
from ptt.effects.base import flatten
from ptt.fit.solve import FitResult, fit
from ptt.model import Model, Term, rival
from ptt.noise import Noise
from ptt.problem import Problem
from ptt.sums import project, solve

LOOKS = 3  # times that a fit and its gross errors may change each other
OPENING = 0.05  # usual sizes: how far open a play starts that the screen found shut

Progress = Callable[[str], None]
Shape = Mapping[str, Tensor]


@dataclass(frozen=True)
class State:
    """A model on the path.

    Attributes:
        fitted: the model with its fit.
        design: linearised there, with every candidate beside it.
        screened: the candidates tested.
        gross: rows left out of the fit, (n,) bool.
    """

    fitted: FitResult
    design: Design
    screened: Screen
    gross: np.ndarray


class Walker:
    """Fits and screens models of one problem; holds what does not change from step to step."""

    def __init__(
        self, problem: Problem, known: Library, noise: Noise, wander: Wander | None, progress: Progress | None = None
    ) -> None:
        """Start with no row held for a gross error.

        Args:
            problem: the readings.
            known: effects by name.
            noise: the noise floor.
            wander: its memory, if it has one.
            progress: told what is being fitted.
        """
        self.problem, self.known, self.noise, self.wander = problem, known, noise, wander
        self.tell = progress or (lambda what: None)
        self.gross = np.zeros(problem.table.rows, dtype=bool)

    def look(self, model: Model, *, fitted: FitResult | None = None) -> State:
        """Fit a model and screen all candidates on top of it; gross errors found by the way are left out of both."""
        fitted = fitted or self.fit(model)
        candidates, _ = present_candidates(fitted, self.problem, self.known)
        design = build_design(fitted, self.problem, candidates, self.noise, wander=self.wander)
        for _ in range(LOOKS):
            gross = self.problem.used & ~design.rows
            if (gross == self.gross).all():
                break
            self.gross = gross
            fitted = self.fit(fitted.model)
            design = build_design(fitted, self.problem, candidates, self.noise, wander=self.wander)
        return State(fitted, design, screen(design), self.gross)

    def fit(self, model: Model) -> FitResult:
        """Fit a model to the rows that are no gross errors."""
        return fit(model, self.problem.masked(self.gross), noise=self.noise, robust=False, coarse=True)

    def fit_swapped(self, state: State, key: str | None, finding: Finding | None) -> FitResult:
        """Fit the model of a state without one effect, or with a candidate added or in its place."""
        model = state.fitted.model if key is None else state.fitted.model.without(key)
        if finding is None:
            return self.fit(model)
        other = rival(finding.trial.effect, model.keys)
        model = model if other is None else model.without(other)  # what is in part the same thing makes room
        self.tell(f"fit {finding.trial.effect.key}")
        return self.fit(model + self._term(state, key, finding))

    def misfit(self, state: State) -> float:
        """Sum of squares that a state's model leaves on the rows that count now."""
        same = (state.gross == self.gross).all()
        return self.misfit_of(state.fitted if same else self.fit(state.fitted.model))

    def misfit_of(self, fitted: FitResult) -> float:
        """Sum of squares in noise units, the priors of held values included, the noise's memory taken off."""
        held = float(np.square(fitted.unknowns[fitted.layout.held]).sum())
        if self.wander is None:
            return fitted.chi2 + held
        rows = self.problem.used & ~self.gross
        values = np.nan_to_num(fitted.residual) @ self.noise.whitener.T
        return float(np.square(take_off(values, self.wander, self.problem, rows)[rows]).sum()) + held

    def _term(self, state: State, key: str | None, finding: Finding) -> Term:
        """The candidate in its best shape, its amplitudes at what the linear problem says."""
        trial, joints = finding.trial, self.problem.view.joints
        finer = trial.effect.refine(self.problem.view, trial.shape)
        if len(finer) > 1:
            return Term(trial.effect, flatten(trial.effect, self._finest(trial.effect, finer, state), joints))
        design = state.design
        rest = [columns for other, columns in design.present.items() if other != key]
        projected = project(*design.sums.total[:3], np.concatenate([design.frame, *rest]).astype(int))
        values = solve(projected.gram, projected.side, projected.left, trial.columns).values
        theta = flatten(trial.effect, trial.shape, joints)
        theta[: len(values)] = torch.as_tensor(values * design.scale[trial.columns])
        return Term(trial.effect, self._inside_bounds(theta, trial.effect))

    def _finest(self, effect: Effect, shapes: Sequence[Shape], state: State) -> Shape:
        """The shape that takes most off the residual.

        Rows in a row that look gross are what a knock leaves when it is placed wrong, so only lone ones are left out.
        """
        near = np.convolve(self.gross, [1, 0, 1], mode="same") > 0
        problem = self.problem.masked(self.gross & ~near)
        design = build_design(
            state.fitted, problem, [effect], self.noise, shapes=shapes, wander=self.wander, sift=False
        )
        return screen(design).findings[0].trial.shape

    def _inside_bounds(self, theta: Tensor, effect: Effect) -> Tensor:
        """Amplitudes that respect the physical bounds, a little open where zero is one."""
        place = 0
        for parameter in (declared.on(self.problem.file.machine.kind) for declared in effect.parameters):
            size = parameter.size(self.problem.view.joints)
            shut = parameter.lower == 0.0 and parameter.role == "linear"
            lower = OPENING * parameter.usual if shut else parameter.lower
            theta[place : place + size] = theta[place : place + size].clamp(lower, parameter.upper)
            place += size
        return theta


def hold(state: State, keys: Sequence[str]) -> np.ndarray:
    """Columns of the frame and of some present effects."""
    return np.concatenate([state.design.frame, *(state.design.present[key] for key in keys)]).astype(int)
