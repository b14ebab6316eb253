"""A single long run on a cluster: chunks lie with the workers, passes send them a point, and sums meet in a tree."""

from collections.abc import Callable, Sequence
from typing import Any

from ptt.run.problem import Problem

TRIES = 4  # of one chunk whose workers die


class Spread:
    """`ptt.fitting.chunks.map_sums` on the workers of a dask cluster.

    Each chunk is sent once and stays where it is; where a worker dies chunks are sent anew.
    """

    def __init__(self, client: Any) -> None:
        self.client = client
        self._of: Sequence[Any] | None = None
        self._placed: list[Any] = []

    def __call__(
        self, work: Callable[..., Any], chunks: Sequence[Callable[[], Problem]], each: Sequence[Any],
        add: Callable[[Any, Any], Any],
    ) -> tuple[list[Any], Any]:  # fmt: skip
        """As `map_sums`."""
        for attempt in range(TRIES):
            if self._of is not chunks:
                self._placed = [self.client.scatter(make(), hash=False) for make in chunks]
                self._of = chunks
            try:
                return self._pass(work, each, add)
            except Exception:  # a chunk that died with its worker is said in several ways
                if attempt == TRIES - 1:
                    raise
                self._of = None  # all are sent anew, to whoever is left
        raise AssertionError

    def _pass(self, work: Callable[..., Any], each: Sequence[Any], add: Callable[[Any, Any], Any]) -> Any:
        submit = self.client.submit
        done = [submit(work, chunk, own, pure=False) for chunk, own in zip(self._placed, each, strict=True)]
        total = self._tree([submit(_second, one, pure=False) for one in done], add)
        parts = self.client.gather([submit(_first, one, pure=False) for one in done])
        return parts, total.result()

    def _tree(self, parts: list[Any], add: Callable[[Any, Any], Any]) -> Any:
        while len(parts) > 1:
            pairs = [parts[place : place + 2] for place in range(0, len(parts), 2)]
            parts = [self.client.submit(add, *pair, pure=False) if len(pair) == 2 else pair[0] for pair in pairs]
        return parts[0]


def _first(pair: tuple[Any, Any]) -> Any:
    return pair[0]


def _second(pair: tuple[Any, Any]) -> Any:
    return pair[1]
