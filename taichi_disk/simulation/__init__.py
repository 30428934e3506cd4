"""Moving a lattice in time: the state, the kernels that step it, and the observables that they record."""
