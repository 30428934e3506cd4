"""The engine: kernels, the choice of the step, the loop over time, whether a run is sound, equilibria."""
