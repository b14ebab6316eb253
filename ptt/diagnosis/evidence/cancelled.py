"""What speaks against effects that do far more than the whole error, so that others have to cancel most of it."""

from collections.abc import Sequence

import numpy as np
from scipy.linalg import lapack

from ptt.diagnosis.evidence.atoms import Atom
from ptt.diagnosis.evidence.state import State
from ptt.diagnosis.noise.memory import MemorySums
from ptt.fitting.factor import factor_of

# Times the errors before and after, from which an effect is there to be cancelled: of 280 effects that were named
# right, faults of all sizes beside each other included, none did 1.45 times as much; stand-ins did 1.8 to 3.5.
MOST_DONE = 1.5
NATS_PER_TIME = 25.0  # nats for each further time the errors, so that twice of them weighs more than a name gains


def nats_of_cancelling(state: State, sums: MemorySums, known: Sequence[Atom], new: Sequence[Atom]) -> float:
    """Nats against effects that do more than the readings show of all of them, beside the tracker's frame.

    Independent causes seldom cancel each other; terms that a fit takes for physics that it does not have often do. The
    evidence alone hardly objects: a prior as wide as each of the two costs a few nats.

    Args:
        state: a set.
        sums: normal sums of its columns.
        known: its effects that are in the model as given, and sizes of the drawing, which are alike in what they do and
            each a little off on every machine. What these explain of the readings is no measure of other effects.
        new: its other effects.
    """
    if not new:
        return 0.0
    posterior = state.posterior
    beside = np.concatenate([np.flatnonzero(state.owner < 0), *(state.of(atom.key) for atom in known)])
    whole, along = sums.square, np.zeros((0, len(state.columns)))
    if len(beside):
        # The frame's wide prior too: a run none of whose rows count says nothing of its own frame.
        factor = factor_of(sums.gram[np.ix_(beside, beside)], 1.0 / posterior.prior_variance[beside])
        along = lapack.dtrtrs(factor, sums.gram[beside], lower=1)[0]
        whole -= float(np.square(lapack.dtrtrs(factor, sums.side[beside], lower=1)[0]).sum())
    left = posterior.penalised_square - float((np.square(posterior.values) / posterior.prior_variance).sum())
    errors = np.sqrt(max(whole, 0.0)) + np.sqrt(max(left, 0.0))
    nats = 0.0
    for atom in new:
        own = state.of(atom.key)
        values = posterior.values[own]
        square = float(values @ sums.gram[np.ix_(own, own)] @ values) - float(np.square(along[:, own] @ values).sum())
        nats += NATS_PER_TIME * max(np.sqrt(max(square, 0.0)) / max(errors, 1e-12) - MOST_DONE, 0.0)
    return nats
