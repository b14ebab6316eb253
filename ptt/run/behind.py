"""How far screws, frames and links of several time constants lag behind the recorded temperature."""

import numpy as np

from ptt.run.fading import kept_shares, trailing

# s: time constants, each twice the one before, from a thin screw's to a heavy frame's
LAGS_S = (300.0, 600.0, 1200.0, 2400.0, 4800.0, 9600.0, 19200.0)


def lags_behind(warmth: np.ndarray, time: np.ndarray, starts: np.ndarray) -> np.ndarray:
    """How much warmer bodies are than the recorded temperature, which they follow late.

    Source: a lumped body, tau dT/dt = T_recorded - T, exact where the recorded temperature is straight between rows. It
    begins at the recorded temperature.

    Args:
        warmth: recorded, (n,) K.
        time: (n,) s.
        starts: rows at which the clock begins anew, (n,) bool.

    Returns:
        (n, m) K, for each time constant of `LAGS_S`.
    """
    step, more = (np.nan_to_num(np.diff(values, prepend=values[:1])) for values in (time, warmth))
    rate = more / np.where((step > 0.0) & ~starts, step, np.inf)
    return np.column_stack([trailing(-lag * rate, kept_shares(step, starts, lag)) for lag in LAGS_S])


def carried_on(behind: np.ndarray, time: np.ndarray, first: np.ndarray) -> np.ndarray:
    """Lags of rows that were worked out as if nothing had gone before them.

    Args:
        behind: these lags, (n, m) K.
        time: (n,) s.
        first: true lags at the first row, (m,) K.

    Returns:
        (n, m) K: what a body has too much or too little at the first row dies away.
    """
    since = np.nan_to_num(time - time[0])[:, None]
    return np.asarray(behind + np.exp(-since / np.array(LAGS_S)) * (first - behind[0]))
