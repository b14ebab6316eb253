"""What an effect is: a stage, parameters, and an additive shift that is linear in its amplitudes."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar, Literal

import torch
from torch import Tensor

from ptt.effects.card import Card
from ptt.effects.layout import family, linear_size, shape_of, weigh
from ptt.effects.parameter import Parameter
from ptt.effects.phrases import Phrase, ValuePhrase, said
from ptt.machine_schema import key_of
from ptt.mechanisms.derivatives import by_parameters
from ptt.mechanisms.protocol import Mechanism
from ptt.run.view import View

Stage = Literal["drive", "geometry", "structure", "metrology"]
STAGES: tuple[Stage, ...] = ("drive", "geometry", "structure", "metrology")
CONTEXTS = {  # what an effect may require -> what the data want where that does not vary
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
        mechanisms: families it fits.
        parameters: amplitudes first ('linear'), shape parameters ('searched', 'given') after them.
        requires: contexts of `View.varies` without which the data cannot test it.
        told_by: context that tells it from a size of the drawing, without which it is one among many; '' for none.
        follows_clock: follows time or temperature, so it is tested against autocorrelated noise.
        stands_for: names of commoner causes that it looks like together, each of which it has to be likelier than.
        stands_for_away: how many where its further values are not zero, as it then looks like more.
        reverses: depends on the way a joint came, so its compensation is reported as the reversal part of a command.
        product: its further values are zero, or the first one times an unknown place, usually one usual size away.
        one_way: no cause makes its values clearly negative, though a fit may have them so.
        of_drawing: a size that the drawing states, which is off a little on every machine.
        of_run: belongs to the run that it was fitted on (a set-up, a knocked tripod), not to the machine.
        card: cause, source, usual size, fingerprint, remedy; None makes one of the docstring.
        phrases: what each parameter above and below zero means.
        noun: what its joints are called on a 3-PTT.
        arm_noun: and on an arm.
        called: the cause in a few words; the name where it has none.
        arm_called: the same on an arm, where it differs.

    Attributes:
        label: tells two of a kind apart, as in two knocks.
    """

    name: ClassVar[str] = ""
    stage: ClassVar[Stage] = "structure"
    mechanisms: ClassVar[tuple[str, ...]] = ("three-ptt", "serial")
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
    def odds_of_kind(self) -> float:
        """Nats against this very one of all those of its kind that there may be; none where there is but one."""
        return 0.0

    def reach(self, view: View) -> float | None:
        """How many times its first value a joint's second one may well be, in their units; None where it may be any.

        Only of effects with just two linear values for each joint.

        Args:
            view: n rows.
        """
        return None

    def largest(self, shape: Mapping[str, Tensor]) -> Mapping[str, float | Tensor]:
        """Up to which size, either way, linear values can be what they are called, with these searched parameters.

        Args:
            shape: the searched and given parameters.

        Returns:
            Stem -> size of those that have one, in its unit, one for all its values or one for each.
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
        return "; ".join(wanting) or None

    def search(self, view: View) -> Sequence[Mapping[str, Tensor]]:
        """Values of the searched and given parameters that are worth trying.

        Args:
            view: n rows.

        Returns:
            One mapping from parameter stem to its values per trial; a single empty one where nothing is searched.
        """
        return ({},)

    def undecided(self, view: View) -> Tensor:
        """Rows at which the side on which it has a joint lie hangs on less than a drawing is known to.

        Args:
            view: n rows.

        Returns:
            (n,) bool.
        """
        return torch.zeros(view.rows, dtype=torch.bool)

    def usual_trial(self, view: View) -> Mapping[str, Tensor]:
        """The trial that stands for the effect where nothing was measured yet; the middle one, if nothing says else."""
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
        """What a trial may stand for: shapes that are one while its amounts are small, and part where they are not.

        Args:
            view: n rows.
            shape: the chosen trial.
            amounts: of its linear parameters, (P,).

        Returns:
            The usual one first; none where these rows do not tell them apart.
        """
        return ()

    def renew(self, values: Mapping[str, Tensor], joints: int) -> Mapping[str, Tensor]:
        """Bring values of an older machine file into the present form.

        Args:
            values: stem -> values as the file has them.
            joints: k.

        Returns:
            The same object where nothing has changed.
        """
        return values

    def basis(self, view: View, shape: Mapping[str, Tensor]) -> Tensor:
        """Shift per unit of each linear parameter.

        Args:
            view: n rows at the stage's input.
            shape: values of the searched and given parameters by stem.

        Returns:
            (n, out, P): out = k (drive), the mechanism's slots (geometry) or 3 (structure, metrology).
        """
        raise NotImplementedError

    def proportions(self, mechanism: Mechanism) -> Tensor | None:
        """How large each value usually is beside the usual size of its parameter.

        Args:
            mechanism: the nominal mechanism.

        Returns:
            (P,) of all parameters in declared order; None where the drawing says nothing of it.
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

    def summed(self, theta: Tensor, view: View) -> Tensor:
        """The same shift for who derives it by the view: what has many values may sum them before it spreads them out.

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
        """Derivative of a shift that is not linear in its parameters by these.

        Args:
            theta: all parameters, flat, in declared order.
            view: n rows at the stage's input.

        Returns:
            (n, out, P).
        """
        return by_parameters(lambda values: self.shift(values, view), theta)

    def say(self, theta: Tensor, std: Tensor, view: View) -> tuple[ValuePhrase, ...]:
        """Put the parameters into words, each with its side.

        Args:
            theta: all parameters, flat.
            std: their standard errors, NaN where none is known.
            view: of the machine.

        Returns:
            One for each value that has a phrase.
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
        """The cause in a few words, with what its shape parameters tell.

        Args:
            theta: all parameters, flat.
            view: of the machine.

        Returns:
            For example 'wind-up, over 2.1 mm of travel'.
        """
        return (self.arm_called if family(view) == "serial" else "") or self.called or self.key
