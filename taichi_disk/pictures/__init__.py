"""What people see of a run: films, stills, pages, curves. It knows no folder of a run,
and computes no result."""
