"""Computation of a scene to its end: the loop over time, the choice of the step, and
checks of the result."""
