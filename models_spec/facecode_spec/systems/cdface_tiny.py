"""CDFace at a size that exports in seconds, for tests; no two numbers of its parts are equal."""

from dataclasses import replace

from facecode_spec.schema import CodebookSpec, SystemSpec
from facecode_spec.systems.codetalker_tiny import SPEC as CODETALKER
from facecode_spec.systems.codetalker_vocaset import SPEC as VOCASET

(FACE,) = CODETALKER.parts
_, MOTION_DECODER = FACE.prior

SPEC: SystemSpec = replace(
    CODETALKER,
    name="cdface-tiny",
    family="cdface",
    reference="the architecture of cdface-vocaset at a small size; not a published system",
    styles=VOCASET.styles[:3],  # so that it trains on a folder of VOCASET
    parts=(
        replace(
            FACE,
            name="lips",
            codebook=CodebookSpec(n_codes=23, codes_per_frame=3, dim=10),
            cross_modal_decoder=replace(FACE.cross_modal_decoder, dim=24, n_heads=3),
            motion_decoder=replace(MOTION_DECODER, dim=30, n_heads=3),
            n_samples=3,
            n_vertices=17,
        ),
        replace(
            FACE,
            name="upper_face",
            cross_modal_decoder=replace(FACE.cross_modal_decoder, n_layers=1),
            n_samples=2,
            conditions_on=("lips",),
            n_vertices=25,
        ),
    ),
)
