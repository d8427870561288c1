"""The packaged model: CodeTalker at a small size on the demo head, listening through Whisper."""

from facecode_spec.schema import (
    CodebookSpec,
    CrossModalDecoderSpec,
    MotionDecoderSpec,
    PartSpec,
    SpeechEncoderSpec,
    SystemSpec,
)

SPEC = SystemSpec(
    name="codetalker-demo",
    family="codetalker",
    reference="the method of Xing et al., CodeTalker, CVPR 2023, on generated speech and motion",
    fps=30.0,
    n_vertices=5886,
    unit="metres",
    metres_per_unit=1.0,
    up_axis="y",
    styles=(
        "natural",
        "precise",
        "calm",
        "lively",
        "mumbling",
        "smiling",
        "stern",
        "weary",
        "astonished",
    ),
    speech_encoder=SpeechEncoderSpec(
        family="whisper",
        frame_grid="interpolate",
        normalise=False,
        min_samples=480,
        architecture={
            "d_model": 384,
            "encoder_layers": 4,
            "encoder_attention_heads": 6,
            "encoder_ffn_dim": 1536,
            "num_mel_bins": 80,
        },
    ),
    parts=(
        PartSpec(
            name="face",
            codebook=CodebookSpec(n_codes=256, codes_per_frame=8, dim=16),
            cross_modal_decoder=CrossModalDecoderSpec(
                dim=256, n_layers=2, n_heads=4, dim_feedforward=512, period=30
            ),
            motion_decoder=MotionDecoderSpec(
                dim=128, n_layers=3, n_heads=4, dim_feedforward=256, negative_slope=0.2
            ),
        ),
    ),
)
