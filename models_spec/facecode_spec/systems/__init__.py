"""The trained systems that facecode knows by name, one module each."""

from facecode_spec.schema import SystemSpec
from facecode_spec.systems import (
    codetalker_biwi,
    codetalker_demo,
    codetalker_tiny,
    codetalker_vocaset,
)

SYSTEMS: dict[str, SystemSpec] = {
    module.SPEC.name: module.SPEC
    for module in (codetalker_vocaset, codetalker_biwi, codetalker_demo, codetalker_tiny)
}

__all__ = ["SYSTEMS"]
