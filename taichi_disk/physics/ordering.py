"""Order the springs so that consecutive ones share no point, and split large lattices into subdomains.

The points come in an order in which the ends of a spring are no further apart in the list than some `reach`, about
1.5 sqrt(N). Subdomains of consecutive points, several times that long, can be moved in parallel: the springs inside one
touch no other. The few springs across the seams are left for afterwards. So each spring is computed once, by one core
at a time, and every sum is taken in the same order on however many cores: no atomic additions, bitwise reproducible.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

BLOCK = 8  # springs handled together, so that their square roots and divisions become one vector instruction
WINDOW = 16  # points whose springs are shuffled among themselves: few enough to stay in the first-level cache
PARALLEL_FROM = 50_000  # points from which two cores gain clearly; they break even near 35,000
MAX_SUBDOMAINS = 8  # of a large lattice: each more leaves another seam to one core
MIN_REACHES = 4  # in a subdomain, so that few of its springs cross a seam


@dataclass(frozen=True)
class Arrangement:
    """The springs in blocks of BLOCK, in the order in which a step takes them.

    Attributes:
        ends: (slots, 2) int32; slots that fill up a block hold springs between two points of their own past the last.
        source: (slots,) the spring in each slot; -1 where it only fills up.
        subdomain_points: points of a subdomain (the last may have fewer); all of them where one core makes all steps.
        subdomain_ends: (subdomains,) int32, the block up to which the springs inside each go; behind the last, the
            seams.
    """

    ends: NDArray[np.int32]
    source: NDArray[np.int64]
    subdomain_points: int
    subdomain_ends: NDArray[np.int32]

    @property
    def blocks(self) -> int:
        return len(self.ends) // BLOCK

    @property
    def subdomains(self) -> int:
        return len(self.subdomain_ends)


def arrange(bonds: NDArray[np.int32], points: int) -> Arrangement:
    """An arrangement of `bonds` (m, 2), sorted by their first points; in subdomains for a large lattice."""
    count = 1
    if points >= PARALLEL_FROM:
        reach = int((bonds[:, 1] - bonds[:, 0]).max())
        count = max(1, min(MAX_SUBDOMAINS, points // (MIN_REACHES * reach)))
    size = -(-points // count)
    count, order = -(-points // size), interleave_springs(bonds, points)
    first, last = bonds[order].T // size
    within = [(first == c) & (last == c) for c in range(count)]
    sources, ends = [], []
    for c, chosen in enumerate([*within, first != last]):  # the seams come last
        source = order[chosen]
        source = np.append(source, np.full(-len(source) % BLOCK, -1))
        filling = points + 2 * min(c, count - 1) + np.arange(2)
        sources.append(source)
        ends.append(np.where(source[:, None] < 0, filling, bonds[source]).astype(np.int32))
    ends_at = np.cumsum([len(source) // BLOCK for source in sources[:-1]]).astype(np.int32)
    return Arrangement(np.concatenate(ends), np.concatenate(sources), size, ends_at)


def interleave_springs(bonds: NDArray[np.int32], points: int) -> NDArray[np.int64]:
    """Order (m,) of `bonds` (m, 2), which are sorted by their first point.

    Adding to a point's force right after another spring has added to it waits for the store before. Springs of one
    colour of a greedy edge colouring share no point; the springs of WINDOW points are taken colour by colour, which
    keeps memory accesses close together. A step is 10 % faster for it.
    """
    used = [0] * points  # bit set of the colours at each point
    colour = np.empty(len(bonds), dtype=np.int64)
    for b, (i, j) in enumerate(bonds.tolist()):
        taken = used[i] | used[j]
        lowest = ~taken & (taken + 1)
        colour[b] = lowest.bit_length() - 1
        used[i] |= lowest
        used[j] |= lowest
    return np.lexsort((bonds[:, 0], colour, bonds[:, 0] // WINDOW))
