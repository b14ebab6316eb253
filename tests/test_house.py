"""The house of files: what the layers of import-linter do not see, since they look at rooms."""

import grimp
import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components


def test_no_file_needs_itself_through_others() -> None:
    graph = grimp.build_graph("ptt", "nets", exclude_type_checking_imports=True)
    files = sorted(name for name in graph.modules if not graph.find_children(name))
    place = {name: number for number, name in enumerate(files)}
    pairs = [
        (place[name], place[to])
        for name in files
        for to in graph.find_modules_directly_imported_by(name)
        if to in place
    ]
    from_, to = np.array(pairs).T
    whole = coo_array((np.ones(len(pairs)), (from_, to)), shape=(len(files),) * 2)
    _, ring = connected_components(whole, directed=True, connection="strong")
    shared = [[files[i] for i in np.flatnonzero(ring == r)] for r in np.flatnonzero(np.bincount(ring) > 1)]
    assert len(pairs) > 1000 and shared == []
