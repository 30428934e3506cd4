"""Sources of error of a scene's result: time step, lattice, number of points and wall (`taichi-disk accuracy`)."""
