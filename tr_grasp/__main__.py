"""``python -m tr_grasp VERB ...``, the same as ``tr-grasp VERB ...``."""

from __future__ import annotations

import sys

from tr_grasp.cli import main

# Worker processes import this file too, and must not run the command again.
if __name__ == "__main__":
    sys.exit(main())
