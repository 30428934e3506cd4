"""An order of the springs in which neighbours in the list share no point, and large lattices cut for several cores.

The points come in an order in which the ends of a spring are no further apart in the list than some `reach`, about
1.5 sqrt(N). Chunks of consecutive points, several times that long, can be moved in parallel: the springs inside a chunk
touch no other. The few springs across the seams between chunks are left for afterwards. So each spring is computed
once, by one core at a time, and every sum is taken in the same order on however many cores: no atomic additions, the
same bytes.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

BLOCK = 8  # springs handled together, so that their square roots and divisions become one vector instruction
WINDOW = 16  # points whose springs are shuffled among themselves: few enough to stay in the first-level cache
PARALLEL_FROM = 50_000  # points from which two cores gain clearly; they break even near 35,000
CHUNKS = 8  # of a large lattice: each more leaves another seam to one core
LEAST_REACHES = 4  # of a chunk, so that seams are short beside it


@dataclass(frozen=True)
class Arrangement:
    """The springs in blocks of `block`, in the order in which a step takes them.

    ends: (slots, 2) int32; slots that fill up a block hold springs between two points of their own past the last.
    source: (slots,) the spring in each slot; -1 where it only fills up.
    chunk_points: points of a chunk (the last may have fewer); all of them where one core makes all steps.
    chunk_ends: (chunks,) int32: the block up to which the springs inside each chunk go; behind the last, the seams.
    """

    block: int
    ends: NDArray[np.int32]
    source: NDArray[np.int64]
    chunk_points: int
    chunk_ends: NDArray[np.int32]

    @property
    def blocks(self) -> int:
        return len(self.ends) // self.block

    @property
    def chunks(self) -> int:
        return len(self.chunk_ends)


def arrange(bonds: NDArray[np.int32], points: int, lanes: int) -> Arrangement:
    """An arrangement of `bonds` (m, 2), sorted by their first points; in chunks for a single large lattice.

    Lanes fill a vector register on their own: their blocks are single springs.
    """
    if lanes == 1 and points >= PARALLEL_FROM:
        reach = int((bonds[:, 1] - bonds[:, 0]).max())
        chunks = min(CHUNKS, points // (LEAST_REACHES * reach))
        if chunks > 1:
            return _in_chunks(bonds, points, -(-points // chunks))
    block = BLOCK if lanes == 1 else 1
    source = _padded(spread(bonds, points), block)
    end = np.array([len(source) // block], np.int32)
    return Arrangement(block, _ends(bonds, source, points, 0), source, points, end)


def spread(bonds: NDArray[np.int32], points: int) -> NDArray[np.int64]:
    """Order (m,) of `bonds` (m, 2), which are sorted by their first point.

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
    return np.lexsort((bonds[:, 0], colour, bonds[:, 0] // WINDOW))


def _in_chunks(bonds: NDArray[np.int32], points: int, chunk_points: int) -> Arrangement:
    chunks = (points - 1) // chunk_points + 1
    order = spread(bonds, points)
    first, last = bonds[order].T // chunk_points
    parts = [_padded(order[(first == c) & (last == c)], BLOCK) for c in range(chunks)]
    chunk_ends = np.cumsum([len(part) for part in parts]).astype(np.int32) // BLOCK
    parts.append(_padded(order[first != last], BLOCK))
    ends = [_ends(bonds, part, points, min(c, chunks - 1)) for c, part in enumerate(parts)]
    return Arrangement(BLOCK, np.concatenate(ends), np.concatenate(parts), chunk_points, chunk_ends)


def _padded(order: NDArray[np.int64], block: int) -> NDArray[np.int64]:
    return np.append(order, np.full(-len(order) % block, -1))


def _ends(bonds: NDArray[np.int32], source: NDArray[np.int64], points: int, chunk: int) -> NDArray[np.int32]:
    filling = np.array([points + 2 * chunk, points + 2 * chunk + 1], np.int32)
    return np.where(source[:, None] < 0, filling, bonds[source]).astype(np.int32)
