"""`taichi-disk bench`: speed and error on this machine, beside other programs that express the same model."""
