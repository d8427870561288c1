"""CodeTalker's VOCASET form at a size that exports in seconds, for tests and first steps."""

from facecode_spec.schema import (
    CodebookSpec,
    CrossModalDecoderSpec,
    MotionDecoderSpec,
    PartSpec,
    SpeechEncoderSpec,
    SystemSpec,
)

SPEC = SystemSpec(
    name="codetalker-tiny",
    family="codetalker",
    reference="the architecture of codetalker-vocaset at a small size; not a published system",
    fps=30.0,
    n_vertices=42,
    unit="metres",
    metres_per_unit=1.0,
    up_axis="y",
    styles=("a", "b", "c"),
    speech_encoder=SpeechEncoderSpec(
        family="wav2vec2",
        frame_grid="interpolate",
        architecture={
            "hidden_size": 48,
            "num_hidden_layers": 1,
            "num_attention_heads": 4,
            "intermediate_size": 64,
            "conv_dim": [16] * 7,
            "num_conv_pos_embeddings": 16,
            "num_conv_pos_embedding_groups": 4,
        },
    ),
    parts=(
        PartSpec(
            name="face",
            codebook=CodebookSpec(n_codes=32, codes_per_frame=4, dim=8),
            cross_modal_decoder=CrossModalDecoderSpec(
                dim=32, n_layers=2, n_heads=4, dim_feedforward=64, period=30
            ),
            motion_decoder=MotionDecoderSpec(
                dim=32, n_layers=2, n_heads=4, dim_feedforward=48, negative_slope=0.2
            ),
        ),
    ),
)
