"""Motion of a lattice: the state, the kernels that step it, and the observables that
they record."""
