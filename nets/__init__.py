"""Gaussian radial basis function network: a regressor with a training domain, and a test whether it helps at all.

Centres without supervision (`nets.centres`), widths (`nets.widths`), weights with supervision (`nets.weights`),
everything else chosen by held-out error (`nets.selection`). `nets.training` joins them.
"""

from nets.domain import Domain, measure_domain
from nets.errors import DigestError, NetsError, NetworkFileError, TrainingDataError
from nets.files import load_rbf, read_notes, save_rbf
from nets.network import GaussianRbf
from nets.result import Candidate, RbfTraining, TriedSetting
from nets.settings import RbfSettings
from nets.training import fit_rbf, muted, train_rbf

__all__ = [
    "Candidate",
    "DigestError",
    "Domain",
    "GaussianRbf",
    "NetsError",
    "NetworkFileError",
    "RbfSettings",
    "RbfTraining",
    "TrainingDataError",
    "TriedSetting",
    "fit_rbf",
    "load_rbf",
    "measure_domain",
    "muted",
    "read_notes",
    "save_rbf",
    "train_rbf",
]
