"""The contract between the exporter and the runtime: systems, graphs, manifest.

Standard library only. Knows neither torch nor onnxruntime.
"""

from facecode_spec.manifest import FORMAT_VERSION, Manifest
from facecode_spec.plain import SpecError
from facecode_spec.schema import SystemSpec

__all__ = ["FORMAT_VERSION", "Manifest", "SpecError", "SystemSpec"]
