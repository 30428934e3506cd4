"""Running a scene to its end: the loop over time, the choice of the step, and whether the result is sound."""
