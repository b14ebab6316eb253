"""Random laws: random functions of variables of a run."""

from collections.abc import Callable

import numpy as np

from ptt.rig.nominal import Array
from ptt.rig.odd_state import RunState, memory_of_warmth
from ptt.rig.schema import Law

WAVES = 8  # cosines in a smooth law: enough that it looks like a draw of a Gaussian process
ROUGHNESS = (1.0, 3.0)  # rad over half of a variable's span: from a third of a wave to one wave over all of it
STEPS = (1, 4)  # least number of steps in a jumpy law, and one more than the greatest
WAVES_A_SPAN = (1.5, 6.5)  # waves of a periodic law over all of a variable's span
SAMPLES = 4000  # random points that a law's mean and rms are taken over, to about two per cent


def random_law(law: Law, state: RunState) -> Array:
    """Values of a random law at every row, for its size to be multiplied by.

    Args:
        law: form, variables, seed.
        state: the run.

    Returns:
        (n,), of zero mean and root mean square 1 if the variables filled their spans evenly.
    """
    spans = np.array(law.span)
    values = np.column_stack([variable(name, state, law.memory_s) for name in law.variables])
    at = (2.0 * values - spans.sum(axis=1)) / (spans[:, 1] - spans[:, 0])  # each span at -1 ... 1
    anywhere = np.random.default_rng([law.law_seed, 202]).uniform(-1.0, 1.0, (SAMPLES, len(spans)))
    sides = [number for number, name in enumerate(law.variables) if name.startswith("direction")]
    anywhere[:, sides] = np.sign(anywhere[:, sides])
    usual = FORMS[law.form](anywhere, law.law_seed)
    return np.asarray((FORMS[law.form](at, law.law_seed) - usual.mean()) / max(float(usual.std()), 1e-9))


def variable(name: str, state: RunState, memory_s: float = 1200.0) -> Array:
    """A variable of a run that a law may depend on.

    Args:
        name: b1.. or q1.., direction1.., speed1.., x, y, z, payload, temperature, memory (of the temperature) or time.
        state: the run.
        memory_s: s, time constant by which `memory` lags behind the temperature.

    Returns:
        (n,), in the units of `RunState`; time as a share of the run, 0 to 1.
    """
    if name == "memory":
        return memory_of_warmth(state, memory_s)
    if name == "time":
        return state.time / max(float(state.time[-1]), 1e-9)
    if name in ("x", "y", "z"):
        return state.tool[:, "xyz".index(name)]
    if name in ("payload", "temperature"):
        return np.asarray(getattr(state, name))
    columns = {"b": state.joint, "q": state.joint, "direction": state.direction, "speed": state.speed}
    return np.asarray(columns[name[:-1]][:, int(name[-1]) - 1])


def _smooth(at: Array, seed: int) -> Array:
    """Sum of plane waves of random directions and phases: nearly a draw of a Gaussian process (random features)."""
    random = np.random.default_rng([seed, 201])
    rough = random.uniform(*ROUGHNESS)
    waves = rough * random.normal(size=(WAVES, at.shape[1]))
    phase, height = random.uniform(0.0, 2.0 * np.pi, WAVES), random.normal(size=WAVES)
    return np.cos(at @ waves.T + phase) @ height


def _jumpy(at: Array, seed: int) -> Array:
    """Sum of steps; each is taken where every variable is beyond a threshold of its own."""
    random = np.random.default_rng([seed, 201])
    count = int(random.integers(*STEPS))
    thresholds, sides = (
        random.uniform(-0.6, 0.6, (count, at.shape[1])),
        random.choice([-1.0, 1.0], (count, at.shape[1])),
    )
    heights = random.choice([-1.0, 1.0], count) * random.uniform(0.5, 1.5, count)
    beyond = (sides * (at[:, None, :] - thresholds) > 0.0).all(axis=-1)
    return beyond @ heights


def _periodic(at: Array, seed: int) -> Array:
    """A plane wave of a random direction with a second harmonic, which flattens or sharpens its crests."""
    random = np.random.default_rng([seed, 201])
    wave = random.normal(size=(at.shape[1],))
    wave = np.pi * random.uniform(*WAVES_A_SPAN) * wave / np.linalg.norm(wave)
    phase: Array = at @ wave + random.uniform(0.0, 2.0 * np.pi)
    return np.asarray(np.cos(phase) + random.uniform(-0.5, 0.5) * np.cos(2.0 * phase))


FORMS: dict[str, Callable[[Array, int], Array]] = {"smooth": _smooth, "jumpy": _jumpy, "periodic": _periodic}
