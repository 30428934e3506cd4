"""Order the springs so that consecutive ones share no point, and split large lattices
into subdomains.

The points are in an order in which the two ends of a spring are at most `reach`, about
1.5 sqrt(N), apart in the list. Subdomains of several times as many consecutive points
can be moved in parallel, because the springs inside a subdomain touch no other. The few
springs across the seams are computed afterwards. So each spring is computed once, and
every sum has the same order on any number of cores: no atomic additions, bitwise
reproducible.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from taichi_disk.mechanics.lattice.triangles import Indices, Long

# springs computed together, so that their square roots and divisions become one vector
# instruction
BLOCK = 8
WINDOW = 16  # points whose springs are interleaved; they fit into the first-level cache
# points from which two cores are clearly faster; they break even near 35,000
PARALLEL_FROM = 50_000
# most subdomains of a large lattice; each adds a seam, which a single core computes
MAX_SUBDOMAINS = 8
# smallest length of a subdomain in units of `reach`, so that few springs cross a seam
MIN_REACHES = 4


@dataclass(frozen=True)
class Arrangement:
    """The springs in blocks of BLOCK, in the order in which a step takes them. Filler
    springs complete a block."""

    # (slots, 2); fillers join two extra points after the last point
    ends: Indices
    # (slots,) index of the spring in each slot; -1 for a filler
    source: Long
    # points per subdomain, of which the last may have fewer; all points for a single
    # core
    subdomain_points: int
    # (subdomains,) block at which the springs inside each subdomain end; the springs
    # across the seams follow
    subdomain_ends: Indices

    @property
    def subdomains(self) -> int:
        return len(self.subdomain_ends)


def arrange(bonds: Indices, points: int) -> Arrangement:
    """Arrange `bonds` (m, 2), which are sorted by their first points, and split a large
    lattice."""
    count = 1
    if points >= PARALLEL_FROM:
        reach = (bonds[:, 1] - bonds[:, 0]).max()
        count = max(1, min(MAX_SUBDOMAINS, points // (MIN_REACHES * reach)))
    size = -(-points // count)
    count = -(-points // size)
    order = interleave_springs(bonds, points)
    first, second = bonds[order].T // size  # subdomains of the two ends
    groups = [order[(first == c) & (second == c)] for c in range(count)]
    groups.append(order[first != second])  # the springs across the seams
    sources = []
    ends = []
    for c, group in enumerate(groups):
        fillers = np.full(-len(group) % BLOCK, -1)
        source = np.append(group, fillers)
        is_filler = source[:, None] < 0
        extra_points = points + 2 * min(c, count - 1) + np.arange(2)
        pairs = np.where(is_filler, extra_points, bonds[source])
        sources.append(source)
        ends.append(pairs.astype(np.int32))
    blocks = [len(source) // BLOCK for source in sources[:-1]]
    return Arrangement(
        ends=np.concatenate(ends),
        source=np.concatenate(sources),
        subdomain_points=size,
        subdomain_ends=np.cumsum(blocks).astype(np.int32),
    )


def interleave_springs(bonds: Indices, points: int) -> Long:
    """Return an order (m,) of `bonds` (m, 2), which are sorted by their first point."""
    # A second addition to the force on a point has to wait until the first is stored.
    # Springs with the same colour in a greedy edge colouring share no point. Within a
    # window of WINDOW points, springs are ordered by colour; this keeps memory accesses
    # local and makes a step 10 % faster.
    used = points * [0]  # set of the colours at each point, as bits
    colour = np.empty(len(bonds), np.int64)
    for b, (i, j) in enumerate(bonds.tolist()):
        occupied = used[i] | used[j]
        lowest = ~occupied & (occupied + 1)
        colour[b] = lowest.bit_length() - 1
        used[i] |= lowest
        used[j] |= lowest
    return np.lexsort((bonds[:, 0], colour, bonds[:, 0] // WINDOW))
