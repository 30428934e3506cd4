"""All Taichi physics: state fields, forces, the stepping kernels, the stable step."""
