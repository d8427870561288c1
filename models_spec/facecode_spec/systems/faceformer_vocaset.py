"""FaceFormer as trained on VOCASET (FLAME topology)."""

from facecode_spec.schema import CrossModalDecoderSpec, PartSpec, SpeechEncoderSpec, SystemSpec

SPEC = SystemSpec(
    name="faceformer-vocaset",
    family="faceformer",
    reference="Fan et al., FaceFormer, CVPR 2022",
    fps=30.0,
    n_vertices=5023,
    unit="metres",
    metres_per_unit=1.0,
    up_axis="y",
    styles=(
        "FaceTalk_170728_03272_TA",
        "FaceTalk_170904_00128_TA",
        "FaceTalk_170725_00137_TA",
        "FaceTalk_170915_00223_TA",
        "FaceTalk_170811_03274_TA",
        "FaceTalk_170913_03279_TA",
        "FaceTalk_170904_03276_TA",
        "FaceTalk_170912_03278_TA",
    ),
    speech_encoder=SpeechEncoderSpec(family="wav2vec2", frame_grid="interpolate"),
    parts=(
        PartSpec(
            name="face",
            codebook=None,
            cross_modal_decoder=CrossModalDecoderSpec(
                dim=64, n_layers=1, n_heads=4, dim_feedforward=128, period=30
            ),
            motion_decoder=None,
        ),
    ),
)
