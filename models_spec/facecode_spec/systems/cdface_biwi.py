"""CDFace on BIWI, each part as large as the face of CodeTalker."""

from dataclasses import replace

from facecode_spec.schema import SystemSpec
from facecode_spec.systems.cdface_demo import REFERENCE
from facecode_spec.systems.codetalker_biwi import SPEC as CODETALKER

(FACE,) = CODETALKER.parts
LIP_VERTICES = 4996
"""The public lip region; the upper face is the rest. Another region file gives other numbers."""
N_SAMPLES = 5
"""Of the lips, and of the upper face for each: the paper's K. As many upper faces, so that faces
differ as much when the lips are held."""

SPEC: SystemSpec = replace(
    CODETALKER,
    name="cdface-biwi",
    family="cdface",
    reference=REFERENCE,
    parts=(
        replace(FACE, name="lips", n_samples=N_SAMPLES, n_vertices=LIP_VERTICES),
        replace(
            FACE,
            name="upper_face",
            n_samples=N_SAMPLES,
            conditions_on=("lips",),
            n_vertices=CODETALKER.n_vertices - LIP_VERTICES,
        ),
    ),
)
