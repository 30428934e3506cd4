"""All Taichi physics: state fields, forces, the stepping kernels, the stable step."""

import os

# Before taichi is first imported: it greets on standard output, where only results belong.
os.environ.setdefault("ENABLE_TAICHI_HEADER_PRINT", "0")
