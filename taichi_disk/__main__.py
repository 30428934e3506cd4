from taichi_disk.cli import process

process()
