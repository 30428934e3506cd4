"""Many runs: sweeps, the laws that are fitted to them, and what limits the accuracy.
It draws no film."""
