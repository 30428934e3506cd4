"""A run as a user has it: `run`, its `Result`, its folder and files. It knows no sweep
and no page of the sandbox."""
