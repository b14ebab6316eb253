"""A machine with its effects and, where one was trained, its network: what `ptt.load` reads and `save` writes."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ptt.correct.training.compensator import Compensator, load_compensator, write_compensator
from ptt.effects import Effect
from ptt.effects.registry import Library, library, make_effect, parse_key
from ptt.errors import InputError, ModelError
from ptt.machine import MachineFile, format_machine, parse_machine, save_machine
from ptt.mechanisms import build_mechanism
from ptt.model.entries import read_model, write_model
from ptt.model.model import Model as Physics
from ptt.model.model import parameter_names, told_values
from ptt.notebook import InNotebook

if TYPE_CHECKING:
    from ptt.correct.predictor import Predictor
    from ptt.mechanisms.protocol import Mechanism

EffectLike = str | Effect | type[Effect]


@dataclass(frozen=True, eq=False, repr=False)
class Model(InNotebook):
    """A machine, the effects that were added to it, and the network that learned what they left.

    Attributes:
        compensator: the physics, and the network where there is one.
        library: effects by name, the user's own included.
        path: file or folder that it was read from; None for one that was made here.
    """

    compensator: Compensator
    library: Library
    path: Path | None = None

    @property
    def physics(self) -> Physics:
        """Drawing and effects with their parameters."""
        return self.compensator.model

    @property
    def file(self) -> MachineFile:
        """The machine file: drawing, controller, tracker, history."""
        return self.physics.file

    @property
    def mechanism(self) -> "Mechanism":
        """The nominal mechanism: `forward`, `inverse`, `jacobian` of float64 torch tensors (`torch.as_tensor(array)`).

        All rows at once: positions (n, 3) mm, joint values (n, k) mm or rad.
        """
        return build_mechanism(self.file.machine)

    def predictor(self) -> "Predictor":
        """Corrected commands one by one or in long runs, by the model's own C; needs a C compiler.

        Raises:
            PttError: there is no compiler.
            InputError: the model has effects that C does not hold.
        """
        from ptt.correct.predictor import Predictor

        return Predictor(self.compensator)

    @property
    def effects(self) -> tuple[str, ...]:
        """Names of the effects, with [label] where they have one."""
        return self.physics.keys

    def save(self, path: str | Path) -> None:
        """Write a machine.toml, or a compensator folder where there is a network; whole or not at all.

        Args:
            path: the file, or the folder.

        Raises:
            InputError: it cannot be written, or a folder holds other files, which would be lost.
        """
        if self.compensator.network is None:
            save_machine(write_model(self.physics), path)
        else:
            write_compensator(path, self.compensator)

    def make(self, effect: EffectLike) -> Effect:
        """Build an effect that this model may be given.

        Args:
            effect: a name, with [label] where it has one; an effect; or its class.

        Returns:
            The effect.

        Raises:
            ModelError: the name is not known.
        """
        if isinstance(effect, Effect):
            return effect
        if isinstance(effect, type) and issubclass(effect, Effect):
            return effect()
        if not isinstance(effect, str):
            what = f"{effect!r} is not an effect"
            raise ModelError(what, fix="give a name, as 'backlash', or an effect, as ptt.effects.Backlash()")
        return make_effect(self.library, *parse_key(effect))

    def knowing(self, effects: Sequence[Effect]) -> "Model":
        """The same model with effects of the user's own in its library.

        Args:
            effects: of classes that may not be in the library yet.

        Raises:
            ModelError: another effect has one of their names.
        """
        known = dict(self.library)
        for effect in effects:
            if known.setdefault(effect.name, type(effect)) is not type(effect):
                raise ModelError(f"effect '{effect.name}' exists already", fix="give yours another name")
        return replace(self, library=known)

    def __str__(self) -> str:
        """The machine in one line, then one line for each effect, then the network."""
        lines = [_drawing(self.file)]
        lines += [_effect(self.physics, index) for index in range(len(self.physics.terms))] or ["no effects"]
        network = self.compensator.network
        if network is not None:
            lines.append(f"network: {self.compensator.notes.get('rbf', {}).get('centres', '?')} nodes")
        return "\n".join(lines)

    __repr__ = __str__


def load(path: str | Path, *, effects: Sequence[str | Path] = ()) -> Model:
    """Read a machine.toml or a compensator folder.

    Args:
        path: file or folder.
        effects: Python files with effects of your own; they are run.

    Returns:
        The model.

    Raises:
        InputError: missing, damaged, or not a machine.
    """
    if not isinstance(path, str | Path):
        raise InputError(
            f"load takes the path of a file or folder, not {kind_of(path)}", fix="as in load('machine.toml')"
        )
    known = library(*((effects,) if isinstance(effects, str | Path) else effects))
    return Model(load_compensator(path, known), known, Path(path))


def model_of(file: MachineFile, known: Library) -> Model:
    """A model as it would be read from the file that `save` writes.

    Args:
        file: the machine with its effects and history.
        known: effects by name.
    """
    return Model(Compensator(read_model(parse_machine(format_machine(file), file.source), known), None, {}), known)


def _drawing(file: MachineFile) -> str:
    spec = file.machine
    if spec.kind == "serial":
        return f"{spec.name}: an arm of {len(spec.joint)} joints"
    sizes = f"R = {spec.base_radius_mm:g}, r = {spec.platform_radius_mm:g}, L = {spec.link_length_mm:g} mm"
    return f"{spec.name}: 3-PTT, {sizes}, sliders {spec.sliders}"


def _effect(model: Physics, index: int) -> str:
    term = model.terms[index]
    if not len(term.theta):
        return f"{term.effect.key}: not fitted yet"
    names = parameter_names(term.effect, model.file.machine.kind, model.joints)
    told = told_values(term.effect, term.theta, model.joints)
    values = zip(names, term.theta.tolist(), told, strict=True)
    return f"{term.effect.key}: {', '.join(f'{name} {value:.4g}' for name, value, said in values if said)}"


def as_model(given: Any, usage: str) -> Model:
    """A model from a model, a result that has one, or the path of one.

    Args:
        given: what was handed over.
        usage: how the verb is called, as 'diagnose(model, run)'.

    Raises:
        InputError: it is something else.
    """
    if isinstance(given, Model):
        return given
    if isinstance(given, str | Path):
        return load(given)
    inner = getattr(given, "model", None)
    if isinstance(inner, Model):
        return inner
    raise InputError(f"{usage}: got {kind_of(given)} where the model belongs", fix="ptt.load reads one from a file")


def kind_of(given: Any) -> str:
    """Type of an argument, in words."""
    return "nothing" if given is None else f"a {type(given).__name__}"
