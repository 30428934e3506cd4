from taichi_disk.cli import main

raise SystemExit(main())
