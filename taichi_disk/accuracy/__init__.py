"""What limits the accuracy of a scene's result: the time step, the lattice or the wall. `taichi-disk accuracy`."""
