"""The part of parameter space that one run determines, from its information matrix."""

import numpy as np

from ptt.fitting.stated import unseen_directions

LEAST_SHARE = 1e-6  # of a value's axis in the seen directions, squared: below it the run says nothing of that value


def seen_inverse(information: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Inverse of an information matrix in the directions that it determines, zero in the others.

    Args:
        information: (p, p), values in units of their usual sizes.

    Returns:
        The covariance in the seen directions, (p, p), and which values have a part in them, (p,) bool.
    """
    unseen = unseen_directions(information)
    seen = np.eye(len(information)) - unseen @ unseen.T
    return seen @ np.linalg.pinv(information, hermitian=True) @ seen, np.diag(seen) > LEAST_SHARE
