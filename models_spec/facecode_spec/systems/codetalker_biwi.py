"""CodeTalker as trained on BIWI."""

from facecode_spec.schema import (
    CodebookSpec,
    CrossModalDecoderSpec,
    MotionDecoderSpec,
    PartSpec,
    SpeechEncoderSpec,
    SystemSpec,
)

SPEC = SystemSpec(
    name="codetalker-biwi",
    family="codetalker",
    reference="Xing et al., CodeTalker, CVPR 2023",
    fps=25.0,
    n_vertices=23370,
    unit="mesh scaled to unit area (about 185 mm)",
    metres_per_unit=0.185,
    up_axis="y",
    styles=("F2", "F3", "F4", "M3", "M4", "M5"),
    speech_encoder=SpeechEncoderSpec(family="wav2vec2", frame_grid="pairs"),
    parts=(
        PartSpec(
            name="face",
            codebook=CodebookSpec(n_codes=256, codes_per_frame=8, dim=128),
            cross_modal_decoder=CrossModalDecoderSpec(
                dim=1024, n_layers=12, n_heads=4, dim_feedforward=2048, period=25
            ),
            motion_decoder=MotionDecoderSpec(
                dim=1024,
                n_layers=6,
                n_heads=8,
                dim_feedforward=1536,
                negative_slope=0.2,
                input_projection=True,
                output_bias=False,
            ),
        ),
    ),
)
