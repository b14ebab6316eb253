"""What was done to sound inputs, and whether the result must be refused."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Mutation:
    """One change of an input.

    Attributes:
        words: what was done.
        verdict: 'refuse' where the file format forbids what was written, 'same' where nothing that matters was changed,
            '' where both are sensible.
    """

    words: str
    verdict: str = ""
