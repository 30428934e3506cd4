"""What people see of a run: films, stills, pages, curves."""
