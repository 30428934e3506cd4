"""Measure what causes errors of a result: time step, lattice, number of points and wall
(`taichi-disk accuracy`)."""
