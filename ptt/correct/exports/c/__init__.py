"""C99 source of a model: commands one after the other, reversal included, agreeing with `ptt predict`."""

from ptt.correct.exports.c.write import write

__all__ = ["write"]
