"""The trained systems that facecode knows by name, one module each."""

from facecode_spec.schema import SystemSpec
from facecode_spec.systems import (
    cdface_biwi,
    cdface_demo,
    cdface_tiny,
    cdface_vocaset,
    codetalker_biwi,
    codetalker_demo,
    codetalker_tiny,
    codetalker_vocaset,
    faceformer_biwi,
    faceformer_tiny,
    faceformer_vocaset,
)

SYSTEMS: dict[str, SystemSpec] = {
    module.SPEC.name: module.SPEC
    for module in (
        *(codetalker_vocaset, codetalker_biwi, codetalker_demo, codetalker_tiny),
        *(cdface_vocaset, cdface_biwi, cdface_demo, cdface_tiny),
        *(faceformer_vocaset, faceformer_biwi, faceformer_tiny),
    )
}

__all__ = ["SYSTEMS"]
