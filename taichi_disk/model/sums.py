"""Rows of the matrix `sums`: what adds up over time, and the powers it adds up, per lane.

It travels through the step as a local matrix and is stored once, at the kernel's end. Taichi 1.7.4 keeps 0-D
fields in registers across loops and hands later readers in the same kernel the value from before: an energy
kept in such a field comes out one launch late.
"""

from __future__ import annotations

SUMS = 9
DISSIPATED, POWER, ABSORBED, BOUNDARY_POWER, PEAK, SLIDING = range(6)
SHIFT, SPEED, PUSH = range(6, SUMS)  # of the moving frame; zero in double precision (see `frame`)
