"""From the table of a sweep to the paper's figures: curves, the laws fitted to them, the drawing."""
