"""The engine: state, stepping, the loop over time, the choice of the step, equilibria."""
