"""Facts on a compensator's network, from its training and on this run."""

from dataclasses import dataclass

import numpy as np

from ptt.correct.training.compensator import Compensator
from ptt.correct.training.rest import inputs_of
from ptt.errors import ModelError
from ptt.record import Record
from ptt.run.axes import AXES
from ptt.run.problem import Problem
from ptt.show.report.source import MadeOf


@dataclass(frozen=True)
class NetworkFacts(Record):
    """The Gaussian RBF network of a compensator.

    Attributes:
        nodes: number of Gaussians.
        learned: axes on which it helped held-out rows; on the others it is zero.
        share: of the held-out variance left by the physics, the part that it removed in training.
        heldout_rms_um: in training, held-out rms error of 'given', 'physics' and 'rbf' by x, y, z and total.
        protocol: which rows were held out, in words.
        trained_on: names of the files that it was trained on.
        this_run: whether one of them is the run of this report; None where the run's hash is not known.
        inside: number of readings of this run inside the training domain.
        readings: number of readings of this run.
        largest_um: largest correction that it makes on this run.
    """

    nodes: int
    learned: tuple[str, ...]
    share: float
    heldout_rms_um: dict[str, dict[str, float]]
    protocol: str
    trained_on: tuple[str, ...]
    this_run: bool | None
    inside: int
    readings: int
    largest_um: float


def network_facts(compensator: Compensator, problem: Problem, source: MadeOf) -> NetworkFacts:
    """Gather the facts on a network.

    Args:
        compensator: with a network.
        problem: the run.
        source: files of the report with their hashes.

    Returns:
        The facts.

    Raises:
        ModelError: compensator.json lacks a key.
    """
    network, notes = compensator.network, compensator.notes
    target = inputs_of(problem, compensator.space)[problem.used]
    assert network is not None
    inside = np.asarray(network.inside(target))
    asked = np.linalg.norm(network.predict(target), axis=1)[inside]
    own = {file.sha256 for file in source.files if file.role in ("run", "also")}
    try:
        return NetworkFacts(
            nodes=int(notes["rbf"]["centres"]),
            learned=tuple(axis for axis, flag in zip(AXES, notes["rbf"]["learned"], strict=True) if flag),
            share=float(notes["rbf"]["share"]),
            heldout_rms_um=notes["heldout_rms_um"],
            protocol=str(notes["protocol"]),
            trained_on=tuple(str(item["file"]) for item in notes["trained_on"]),
            this_run=any(item["sha256"] in own for item in notes["trained_on"]) if own else None,
            inside=int(inside.sum()),
            readings=len(target),
            largest_um=1e3 * float(asked.max(initial=0.0)),
        )
    except KeyError as error:
        raise ModelError(f"compensator.json lacks {error}", fix="train it again") from None
