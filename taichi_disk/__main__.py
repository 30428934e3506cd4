from taichi_disk.cli import process

raise SystemExit(process())
