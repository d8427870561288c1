"""`python -m facecode_exporter.cli`."""

import sys

from facecode_exporter.cli.main import main

sys.exit(main())
