"""`python -m facecode.cli`."""

import sys

from facecode.cli.main import main

sys.exit(main())
