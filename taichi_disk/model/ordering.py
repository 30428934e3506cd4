"""An order of the springs in which neighbours in the list share no point, and large lattices cut for several cores.

The points come in an order in which the ends of a spring are no further apart in the list than some `reach`, about
1.5 sqrt(N). Chunks of consecutive points, several times that long, can be moved in parallel: the springs inside a chunk
touch no other. The few springs across the seams between chunks are left for afterwards. So each spring is computed
once, by one core at a time, and every sum is taken in the same order on however many cores: no atomic additions, the
same bytes.

A chunk is moved strip by strip: its springs are sorted by their second, later point, so that those that end in a strip
can be taken right after its points have moved, while these and their neighbours are still in the cache.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

BLOCK = 4  # springs handled together, so that their square roots and divisions become one vector instruction
WINDOW = 16  # points whose springs are shuffled among themselves: few enough to stay in the first-level cache
PARALLEL_FROM = 50_000  # points from which two cores gain clearly; they break even near 25,000
STRIP = 256  # points of a strip: with their springs some 30 kB
CHUNKS = 8  # of a large lattice: each more leaves another seam to one core
LEAST_REACHES = 4  # of a chunk, so that seams are short beside it


@dataclass(frozen=True)
class Arrangement:
    """The springs in blocks of `block`, in the order in which a step takes them.

    ends: (slots, 2) int32; slots that fill up a block hold springs between two points of their own past the last.
    source: (slots,) the spring in each slot; -1 where it only fills up.
    chunks: how many; 1 where all steps are made by one core, without strips.
    strip: points of a strip.
    chunk_strips: strips of a chunk (the last chunk may have fewer).
    strips: (strips,) int32: the block up to which springs are taken after each strip; behind the last, the seams.
    """

    block: int
    ends: NDArray[np.int32]
    source: NDArray[np.int64]
    chunks: int
    strip: int
    chunk_strips: int
    strips: NDArray[np.int32]

    @property
    def blocks(self) -> int:
        return len(self.ends) // self.block


def arrange(bonds: NDArray[np.int32], points: int, lanes: int) -> Arrangement:
    """An arrangement of `bonds` (m, 2), sorted by their first points; in chunks for a single large lattice.

    Lanes fill a vector register on their own: their blocks are single springs.
    """
    if lanes == 1 and points >= PARALLEL_FROM:
        reach = int((bonds[:, 1] - bonds[:, 0]).max())
        chunks = min(CHUNKS, points // (LEAST_REACHES * reach))
        if chunks > 1:
            return _in_chunks(bonds, points, -(-points // (chunks * STRIP)))
    block = BLOCK if lanes == 1 else 1
    source = _padded(spread(bonds, bonds[:, 0], points), block)
    return Arrangement(block, _ends(bonds, source, points, 0), source, 1, points, 1, np.zeros(0, np.int32))


def spread(bonds: NDArray[np.int32], sorted_by: NDArray[np.int32], points: int) -> NDArray[np.int64]:
    """Order (m,) of `bonds` (m, 2) by windows of the points `sorted_by` (m,), colour by colour within a window.

    Adding to a point's force right after another spring has added to it waits for the store before. Springs of
    one colour of a greedy edge colouring share no point; the springs of WINDOW points are taken colour by colour,
    which keeps memory accesses close together. A step is 10 % faster for it.
    """
    used = [0] * points  # bit set of the colours at each point
    colour = np.empty(len(bonds), dtype=np.int64)
    for b, (i, j) in enumerate(bonds.tolist()):
        taken = used[i] | used[j]
        lowest = ~taken & (taken + 1)
        colour[b] = lowest.bit_length() - 1
        used[i] |= lowest
        used[j] |= lowest
    return np.lexsort((sorted_by, colour, sorted_by // WINDOW))


def _in_chunks(bonds: NDArray[np.int32], points: int, chunk_strips: int) -> Arrangement:
    length = chunk_strips * STRIP
    chunks = (points - 1) // length + 1
    order = spread(bonds, bonds[:, 1], points)
    first, last = bonds[order].T // length
    strips = np.zeros((points - 1) // STRIP + 1, np.int32)
    parts, begun = [], 0
    for c in range(chunks):
        inside = order[(first == c) & (last == c)]
        own = np.arange(c * chunk_strips, min((c + 1) * chunk_strips, len(strips)))
        # Whole blocks only: one that ends in the next strip waits for it.
        strips[own] = begun + np.searchsorted(bonds[inside, 1] // STRIP, own, "right") // BLOCK
        parts.append(_padded(inside, BLOCK))
        begun += len(parts[-1]) // BLOCK
        strips[own[-1]] = begun
    parts.append(_padded(order[first != last], BLOCK))
    ends = [_ends(bonds, part, points, min(c, chunks - 1)) for c, part in enumerate(parts)]
    return Arrangement(BLOCK, np.concatenate(ends), np.concatenate(parts), chunks, STRIP, chunk_strips, strips)


def _padded(order: NDArray[np.int64], block: int) -> NDArray[np.int64]:
    return np.append(order, np.full(-len(order) % block, -1))


def _ends(bonds: NDArray[np.int32], source: NDArray[np.int64], points: int, chunk: int) -> NDArray[np.int32]:
    filling = np.array([points + 2 * chunk, points + 2 * chunk + 1], np.int32)
    return np.where(source[:, None] < 0, filling, bonds[source]).astype(np.int32)
