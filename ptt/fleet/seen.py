"""What one run's information tells of its values: the directions that its rows see, all values free."""

import numpy as np

from ptt.fitting.stated import unseen_directions

LEAST_SHARE = 1e-6  # of a value in the directions that are seen: below it nothing is told of it


def seen_inverse(information: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Inverse of an information in the directions that it sees, nothing in the others.

    Args:
        information: (p, p) in usual sizes.

    Returns:
        The covariance of what is seen, (p, p), and which values have a part in it, (p,) bool.
    """
    unseen = unseen_directions(information)
    seen = np.eye(len(information)) - unseen @ unseen.T
    return seen @ np.linalg.pinv(information, hermitian=True) @ seen, np.diag(seen) > LEAST_SHARE
