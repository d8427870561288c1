"""FaceFormer as trained on BIWI."""

from facecode_spec.schema import CrossModalDecoderSpec, PartSpec, SpeechEncoderSpec, SystemSpec

SPEC = SystemSpec(
    name="faceformer-biwi",
    family="faceformer",
    reference="Fan et al., FaceFormer, CVPR 2022",
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
            codebook=None,
            cross_modal_decoder=CrossModalDecoderSpec(
                dim=128, n_layers=1, n_heads=4, dim_feedforward=256, period=25
            ),
            motion_decoder=None,
        ),
    ),
)
