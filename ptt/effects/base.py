"""What an effect is: a stage, parameters, and an additive shift that is linear in its amplitudes."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar, Literal

import torch
from torch import Tensor

from ptt.effects.card import Card
from ptt.effects.layout import family, flatten, linear_size, shape_of, weigh
from ptt.effects.parameter import Parameter
from ptt.effects.phrases import Phrase, ValuePhrase, said
from ptt.machine_schema import key_of
from ptt.mechanisms.derivatives import by_parameters
from ptt.mechanisms.protocol import Mechanism
from ptt.run.view import View

Stage = Literal["drive", "geometry", "structure", "metrology"]
STAGES: tuple[Stage, ...] = ("drive", "geometry", "structure", "metrology")
CONTEXTS = {  # context that an effect may require -> what the user is told to measure where it does not vary
    "payload": "column payload_kg with at least two loads",
    "temperature": "column temp_c with a change of temperature",
    "time": "column time_s over more than an instant",
    "speed": "readings on the move at two or more speeds (feed_mm_s, or time_s)",
    "direction": "poses reached from both directions",
}


@dataclass(frozen=True)
class Effect:
    """Base of all effects. A library effect or a user's own overrides `basis`, or `shift` where it is not linear.

    Class attributes:
        name: as in machine.toml.
        stage: where in the causal chain the shift is added.
        mechanisms: mechanism families that it applies to.
        least_joints: joints that an arm has to have: 5 where it is of joint 5; arms that it is tried on have that many.
        parameters: amplitudes first ('linear'), shape parameters ('searched', 'given') after them.
        requires: contexts of `View.varies` without which the data cannot test it.
        told_by: context that has to vary before the data can tell it from an error of the drawing's dimensions; '' for
            none.
        follows_clock: follows time or temperature: in the readings a drift, and no size of the drawing.
        stands_for: names of more common effects whose sum it imitates; its prior odds are theirs taken together.
        stands_for_away: how many it imitates where its further values are not zero.
        reverses: depends on the direction of arrival or the travel before, so its compensation is reported as the
            reversal part of a command.
        product: its further values are zero, or its first value times an unknown position (s c for a scale about c),
            usually about one usual size.
        one_way: clearly negative values have no physical cause, although a fit may give them.
        of_drawing: error of a dimension that the drawing states, present a little on every machine.
        of_run: belongs to the run that it was fitted on (a set-up, a knocked tripod), not to the machine.
        card: cause, source, usual size, fingerprint, remedy; None makes one from the docstring.
        phrases: what a positive and a negative value of each parameter mean, in words.
        noun: what its joints are called on a 3-PTT.
        arm_noun: what they are called on an arm.
        called: the cause in a few words; '' for the name.
        arm_called: the same on an arm; '' where it does not differ.

    Attributes:
        label: tells two effects of one name apart, as in two knocks.
    """

    name: ClassVar[str] = ""
    stage: ClassVar[Stage] = "structure"
    mechanisms: ClassVar[tuple[str, ...]] = ("three-ptt", "serial")
    least_joints: ClassVar[int] = 1
    parameters: ClassVar[tuple[Parameter, ...]] = ()
    requires: ClassVar[tuple[str, ...]] = ()
    told_by: ClassVar[str] = ""
    follows_clock: ClassVar[bool] = False
    stands_for: ClassVar[tuple[str, ...]] = ()
    stands_for_away: ClassVar[int] = 1
    reverses: ClassVar[bool] = False
    product: ClassVar[bool] = False
    one_way: ClassVar[bool] = False
    of_drawing: ClassVar[bool] = False
    of_run: ClassVar[bool] = False
    card: ClassVar[Card | None] = None
    phrases: ClassVar[tuple[Phrase, ...]] = ()
    noun: ClassVar[str] = "slider"
    arm_noun: ClassVar[str] = "joint"
    called: ClassVar[str] = ""
    arm_called: ClassVar[str] = ""

    label: str = ""

    @property
    def key(self) -> str:
        """Name, with the label in brackets where there is one."""
        return key_of(self.name, self.label)

    @property
    def shown(self) -> tuple[int, int]:
        """Joints, from 0, whose error a picture shows and whose variable it shows it against."""
        return 0, 0

    @property
    def odds_of_kind(self) -> float:
        """Nats of prior odds against this one among all of its kind (harmonic m of all m); 0 where it is alone."""
        return 0.0

    def odds_of_shape(self, shape: Mapping[str, Tensor]) -> float:
        """Nats of prior odds against a shape that is less simple than the first one of the search.

        Args:
            shape: the searched and given parameters.
        """
        return 0.0

    def ratio_limit(self, view: View) -> float | None:
        """Largest plausible ratio of a joint's second value to its first, in their units; None where there is none.

        For effects with exactly two linear values for each joint; a diagnosis holds larger ratios against the effect.

        Args:
            view: n rows.
        """
        return None

    def largest(self, shape: Mapping[str, Tensor]) -> Mapping[str, float | Tensor]:
        """Largest magnitude of linear values that their cause can produce, given the searched parameters.

        Args:
            shape: the searched and given parameters.

        Returns:
            Stem -> magnitude in the parameter's unit, one for all its values or one for each; parameters without such a
            limit are left out.
        """
        return {}

    def needs(self, view: View) -> str | None:
        """What the data lack for this effect to be tested.

        Args:
            view: n rows.

        Returns:
            One line for the user, or None where the data can test it.
        """
        wanting = [CONTEXTS[context] for context in self.requires if context not in view.varies]
        wanting += [f"an arm of {self.least_joints} joints"] if self.least_joints > view.joints else []
        return "; ".join(wanting) or None

    def lacks(self, theta: Tensor, view: View) -> str | None:
        """What the data lack for values that it has already to be fitted again; as `needs`.

        Args:
            theta: all parameters, flat.
            view: n rows.
        """
        return self.needs(view)

    def search(self, view: View) -> Sequence[Mapping[str, Tensor]]:
        """Values of the searched and given parameters that are worth trying.

        Args:
            view: n rows.

        Returns:
            One mapping from parameter stem to its values for each trial; a single empty one where nothing is searched.
        """
        return ({},)

    def undecided(self, view: View) -> Tensor:
        """Rows at which errors of the drawing decide on which side of a discontinuity the effect puts a joint.

        Args:
            view: n rows.

        Returns:
            (n,) bool.
        """
        return torch.zeros(view.rows, dtype=torch.bool)

    def usual_trial(self, view: View) -> Mapping[str, Tensor]:
        """The trial that stands for the effect before anything was measured (plans, pictures): here the middle one."""
        trials = self.search(view)
        return trials[len(trials) // 2]

    def refine(self, view: View, shape: Mapping[str, Tensor]) -> Sequence[Mapping[str, Tensor]]:
        """Values near a trial that are worth trying once it has been chosen.

        Args:
            view: n rows.
            shape: the chosen trial.

        Returns:
            As `search`; the trial alone where a fit refines it, or nothing is searched.
        """
        return (shape,)

    def meant_by(self, view: View, shape: Mapping[str, Tensor], amounts: Tensor) -> Sequence[Mapping[str, Tensor]]:
        """Shapes that share this trial as their small-amplitude limit and differ at the amplitudes found.

        Args:
            view: n rows.
            shape: the chosen trial.
            amounts: values of its linear parameters, (P,).

        Returns:
            The shapes to compare, the usual one first; none where these rows do not tell them apart.
        """
        return ()

    def over_its_range(self, view: View) -> View:
        """Rows on which the effect acts, where it has a range of its own: for checks that it does something.

        Args:
            view: n rows in which every context varies.

        Returns:
            The rows with the effect's variable spread over its range; as given where it has none.
        """
        return view

    def basis(self, view: View, shape: Mapping[str, Tensor]) -> Tensor:
        """Shift per unit of each linear parameter; of an effect that has a `shift` alone, its derivative at zero.

        Args:
            view: n rows at the stage's input.
            shape: values of the searched and given parameters by stem.

        Returns:
            (n, out, P): out = k (drive), the mechanism's slots (geometry) or 3 (structure, metrology).
        """
        if type(self).shift is Effect.shift:
            raise NotImplementedError
        return self.slope(flatten(self, shape, view.joints), view)[..., : linear_size(self, view.joints)]

    def proportions(self, mechanism: Mechanism) -> Tensor | None:
        """How large each value usually is, as a share of its parameter's usual size.

        Args:
            mechanism: the nominal mechanism.

        Returns:
            (P,) of all parameters in declared order; None where all of them are 1.
        """
        return None

    def shift(self, theta: Tensor, view: View) -> Tensor:
        """Additive shift at the stage's output.

        Args:
            theta: all parameters, flat, in declared order.
            view: n rows at the stage's input.

        Returns:
            (n, out) in the stage's unit; zero where theta's linear part is zero.
        """
        linear = linear_size(self, view.joints)
        return weigh(self.basis(view, shape_of(self, theta, view.joints)), theta[:linear])

    def differentiable_shift(self, theta: Tensor, view: View) -> Tensor:
        """Equal to `shift`, in the form that autograd differentiates by the view's q and p at least cost.

        An effect with many values may override it to sum them before they are spread over the outputs.

        Args:
            theta: as in `shift`.
            view: as in `shift`.

        Returns:
            As `shift`.
        """
        return self.shift(theta, view)

    def slope_by(self, stem: str, linear: Tensor, view: View, shape: Mapping[str, Tensor]) -> Tensor:
        """Derivative of the shift by one searched parameter.

        Args:
            stem: of the parameter.
            linear: values of the linear parameters, flat.
            view: n rows at the stage's input.
            shape: values of the searched and given parameters by stem.

        Returns:
            (n, out, size of the parameter).
        """
        return by_parameters(lambda values: weigh(self.basis(view, {**shape, stem: values}), linear), shape[stem])

    def slope(self, theta: Tensor, view: View) -> Tensor:
        """Derivative of the shift by all its parameters, for effects that override `shift`.

        Args:
            theta: all parameters, flat, in declared order.
            view: n rows at the stage's input.

        Returns:
            (n, out, P).
        """
        return by_parameters(lambda values: self.shift(values, view), theta)

    def say(self, theta: Tensor, std: Tensor, view: View) -> tuple[ValuePhrase, ...]:
        """Put the parameter values into words.

        Args:
            theta: all parameters, flat.
            std: their standard errors, NaN where none is known.
            view: n rows of the machine.

        Returns:
            The words of each value that has a phrase.
        """
        kind, parts, start = family(view), [], 0
        lead = view.lead if kind == "three-ptt" else None
        for parameter in (declared.on(kind) for declared in self.parameters):
            phrase = next((item for item in self.phrases if item.stem == parameter.stem), None)
            size = parameter.size(view.joints)
            for index in range(size) if phrase else ():
                joint = index // parameter.count + 1 if parameter.per_joint else 0
                value, error = float(theta[start + index]), float(std[start + index])
                own = phrase.along("xyz"[index]) if phrase and 1 < size <= 3 and not joint else phrase
                assert own is not None
                parts.append(said(own, value, error, parameter.unit, parameter.usual, joint, kind, lead))
            start += size
        return tuple(parts)

    def cause(self, theta: Tensor, view: View) -> str:
        """The cause in a few words, with its shape parameters where they matter.

        Args:
            theta: all parameters, flat.
            view: n rows of the machine.

        Returns:
            For example 'wind-up, over 2.1 mm of travel'.
        """
        return (self.arm_called if family(view) == "serial" else "") or self.called or self.key

    def cause_measured(self, theta: Tensor, view: View, measured: Tensor) -> str:
        """The cause without shape parameters that no reading tells.

        Args:
            theta: all parameters, flat, (P,).
            view: n rows of the machine.
            measured: (P,) bool, whether readings tell each of them.
        """
        return self.cause(theta, view)
