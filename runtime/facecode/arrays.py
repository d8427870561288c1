"""Names for the arrays that travel through the runtime. B clips (or samples), T frames.

Audio      (n_samples,) float32, mono, at the model's rate
Codes      (B, T, H) int64
Vectors    (B, T, H, C) float32, codebook rows
Features   (B, H, C) float32, what the decoder step gives for one frame
Offsets    (T, V, 3) float32, in the unit of the bundle
Template   (V, 3) float32
Faces      (F, 3) int32, vertex indices
Colours    (V, 3) uint8, RGB
Indices    (n,) int32, vertex indices
"""

from __future__ import annotations

from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

Float32 = NDArray[np.float32]
Audio: TypeAlias = Float32
Codes: TypeAlias = NDArray[np.int64]
Vectors: TypeAlias = Float32
Features: TypeAlias = Float32
Offsets: TypeAlias = Float32
Template: TypeAlias = Float32
Faces: TypeAlias = NDArray[np.int32]
Indices: TypeAlias = NDArray[np.int32]
Colours: TypeAlias = NDArray[np.uint8]
AnyArray: TypeAlias = NDArray[Any]
