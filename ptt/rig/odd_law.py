"""Laws that nobody wrote down: random functions of random variables."""

import numpy as np

from ptt.rig.nominal import Array
from ptt.rig.odd_schema import RandomLaw
from ptt.rig.odd_state import RunState
from ptt.rig.thermal import lag

WAVES = 8  # cosines in a smooth law
ROUGHNESS = (1.0, 3.0)  # radians over half of a variable's span: from half a wave to a wave over all of it
STEPS = (1, 4)  # steps in a jumpy law
SAMPLES = 4000  # over which a law is brought to zero mean and unit size


def random_law(law: RandomLaw, state: RunState) -> Array:
    """Size of a law at every row.

    Args:
        law: form, variables, seed.
        state: the run.

    Returns:
        (n,) um, of zero mean and root mean square `size_um` if the variables filled their spans evenly.
    """
    function = _smooth if law.form == "smooth" else _jumpy
    anywhere = np.random.default_rng([law.law_seed, 202]).uniform(-1.0, 1.0, (SAMPLES, len(law.variables)))
    sides = [number for number, name in enumerate(law.variables) if name.startswith("direction")]
    anywhere[:, sides] = np.sign(anywhere[:, sides])
    usual = function(anywhere, law.law_seed)
    here = function(_scaled(law, state), law.law_seed)
    return law.size_um * (here - usual.mean()) / max(float(usual.std()), 1e-9)


def variable(name: str, state: RunState, memory_s: float = 1200.0) -> Array:
    """A variable of a run.

    Args:
        name: as in RandomLaw.
        state: the run.
        memory_s: how long warmth is remembered.

    Returns:
        (n,), time as a share of the run.
    """
    if name == "memory":
        step = np.diff(state.time, prepend=0.0)
        return lag(state.temperature[:, None], step, memory_s, float(state.temperature[0]))[:, 0]
    if name in ("x", "y", "z"):
        return state.tool[:, "xyz".index(name)]
    if name == "time":
        return state.time / max(float(state.time[-1]), 1e-9)
    if name in ("payload", "temperature"):
        return np.asarray(getattr(state, name))
    columns = {"b": state.slider, "direction": state.direction, "speed": state.speed}
    return np.asarray(columns[name[:-1]][:, int(name[-1]) - 1])


def _scaled(law: RandomLaw, state: RunState) -> Array:
    """(n, k), the variables with their spans at -1 ... 1."""
    columns = [variable(name, state, law.memory_s) for name in law.variables]
    spans = np.array(law.span)
    return (2.0 * np.column_stack(columns) - spans.sum(axis=1)) / (spans[:, 1] - spans[:, 0])


def _smooth(at: Array, seed: int) -> Array:
    """Sum of plane waves in random directions: a draw of a Gaussian process."""
    random = np.random.default_rng([seed, 201])
    rough = random.uniform(*ROUGHNESS)
    waves = rough * random.normal(size=(WAVES, at.shape[1]))
    phase, height = random.uniform(0.0, 2.0 * np.pi, WAVES), random.normal(size=WAVES)
    return np.cos(at @ waves.T + phase) @ height


def _jumpy(at: Array, seed: int) -> Array:
    """Sum of steps, each beyond a threshold in every variable."""
    random = np.random.default_rng([seed, 201])
    count = int(random.integers(*STEPS))
    thresholds, sides = (
        random.uniform(-0.6, 0.6, (count, at.shape[1])),
        random.choice([-1.0, 1.0], (count, at.shape[1])),
    )
    heights = random.choice([-1.0, 1.0], count) * random.uniform(0.5, 1.5, count)
    beyond = (sides * (at[:, None, :] - thresholds) > 0.0).all(axis=-1)
    return beyond @ heights
