"""What a run leaves: its folder, result files, plot, the lines on the screen, trajectories for other programs."""
