"""A run as a user has it: `run`, its `Result`, its folder and files."""
