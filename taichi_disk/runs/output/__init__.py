"""The output of a run: its folder, result files, plot, printed lines, and trajectories
for other programs."""
