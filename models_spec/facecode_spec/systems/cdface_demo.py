"""The packaged diverse model: a small CDFace on the demo head, listening through Whisper."""

from facecode_spec.schema import (
    CodebookSpec,
    CrossModalDecoderSpec,
    MotionDecoderSpec,
    PartSpec,
    SystemSpec,
)
from facecode_spec.systems.codetalker_demo import SPEC as CODETALKER

REFERENCE = (
    "Gu, Kuriyama and Hotta, Diverse Code Query Learning for Speech-Driven Facial Animation, 2024"
)
LIP_VERTICES = 2357
"""Of the demo head: all that mouth units move more than the others do."""

SPEC = SystemSpec(
    name="cdface-demo",
    family="cdface",
    reference=f"the method of {REFERENCE}, on generated speech and motion",
    fps=CODETALKER.fps,
    n_vertices=CODETALKER.n_vertices,
    unit=CODETALKER.unit,
    metres_per_unit=CODETALKER.metres_per_unit,
    up_axis=CODETALKER.up_axis,
    styles=CODETALKER.styles,
    speech_encoder=CODETALKER.speech_encoder,
    parts=(
        PartSpec(
            name="lips",
            codebook=CodebookSpec(n_codes=256, codes_per_frame=8, dim=16),
            cross_modal_decoder=CrossModalDecoderSpec(
                dim=192, n_layers=2, n_heads=4, dim_feedforward=384, period=30
            ),
            motion_decoder=MotionDecoderSpec(
                dim=128, n_layers=2, n_heads=4, dim_feedforward=256, negative_slope=0.2
            ),
            n_samples=5,
            n_vertices=LIP_VERTICES,
        ),
        PartSpec(
            name="upper_face",
            codebook=CodebookSpec(n_codes=256, codes_per_frame=6, dim=16),
            cross_modal_decoder=CrossModalDecoderSpec(
                dim=128, n_layers=2, n_heads=4, dim_feedforward=256, period=30
            ),
            motion_decoder=MotionDecoderSpec(
                dim=96, n_layers=2, n_heads=4, dim_feedforward=192, negative_slope=0.2
            ),
            n_samples=5,
            conditions_on=("lips",),
            n_vertices=CODETALKER.n_vertices - LIP_VERTICES,
        ),
    ),
)
