"""The sandbox: the disk lives in a window, and the hand changes it while it moves."""
