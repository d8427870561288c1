"""FaceFormer's VOCASET form at a size that exports in seconds, for tests and first steps."""

from facecode_spec.schema import CrossModalDecoderSpec, PartSpec, SpeechEncoderSpec, SystemSpec

SPEC = SystemSpec(
    name="faceformer-tiny",
    family="faceformer",
    reference="the architecture of faceformer-vocaset at a small size; not a published system",
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
            codebook=None,
            cross_modal_decoder=CrossModalDecoderSpec(
                dim=32, n_layers=1, n_heads=4, dim_feedforward=64, period=30
            ),
            motion_decoder=None,
        ),
    ),
)
