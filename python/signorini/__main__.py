"""``python -m signorini`` is the command ``signorini``."""

import sys

from ._program import main

sys.exit(main())
