"""Pictures and films of the disk: drawn on a GGUI canvas, completed with text and
curves, and encoded."""
