"""Other processes that carry out calls."""
