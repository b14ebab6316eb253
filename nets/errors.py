"""What the network package refuses; each message says what is wrong, where, and the way out."""


class NetsError(ValueError):
    """Anything the network package refuses."""


class TrainingDataError(NetsError):
    """Inputs, outputs, groups or settings that no network can be trained on."""


class NetworkFileError(NetsError):
    """A file that is not a saved Gaussian RBF network, or a newer format."""


class DigestError(NetworkFileError):
    """A network file whose SHA-256 digest is unknown or is not the expected one."""
