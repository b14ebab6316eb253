"""Readers of tracker files: from the bytes of an export to columns with known meaning and unit.

The steps, a file each: `text` (encoding, delimiter, decimal sign, comments), `titles` (what a header says, in English
or Chinese), `units` (in what the numbers are), `footer` (rows that are no readings), `layout` (files without a header,
SpatialAnalyzer), `series` (titles that count the joints), `export` (columns to numbers), `stamps` (dates to seconds),
`clock` (dates in a column of their own), `told` (what was understood), `pairing` (an export and its targets), `likely`
(columns that may be commands), `order` (rows in the order of travel). `mapping` holds the answers that can be saved and
reused.
"""

from ptt.run.readers.export import Export, Request, read_any
from ptt.run.readers.mapping import Ask, Mapping, Understood, load_mapping, save_mapping
from ptt.run.readers.pairing import pair_targets

__all__ = [
    "Ask",
    "Export",
    "Mapping",
    "Request",
    "Understood",
    "load_mapping",
    "pair_targets",
    "read_any",
    "save_mapping",
]
