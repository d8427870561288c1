"""Channels of a .csv or .json as OpenFaceFX reads them, not thinned, as JSON on stdout.

python openfacefx_tracks.py FOLDER FILE: {name: [[seconds, weight], ...]}.
"""

import json
import sys
from pathlib import Path

sys.path.insert(0, str(Path(sys.argv[1]).parent))

from openfacefx.export_a2f import read_a2f
from openfacefx.importers_csv import read_csv

path = sys.argv[2]
if path.endswith(".csv"):
    track, warnings = read_csv(path, fps=60.0, epsilon=0.0)  # as the app's timecode counts
else:
    track, warnings = read_a2f(path, epsilon=0.0)
assert not warnings, warnings
print(json.dumps({c.name: [[k.time, k.value] for k in c.keys] for c in track.channels}))
