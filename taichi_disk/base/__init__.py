"""What every part of the program needs: messages, signals, progress, files, processes,
and the start of Taichi. It knows no disk."""
