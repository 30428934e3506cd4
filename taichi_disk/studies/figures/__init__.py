"""The paper's figures from the table of a sweep: curves, the laws fitted to them, and
their drawing."""
