"""Pictures and films of the disk: one drawing routine on a GGUI canvas, text around it, MP4 behind it."""
