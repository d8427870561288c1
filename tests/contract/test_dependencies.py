"""facecode_spec <- facecode <- facecode_exporter; the runtime never loads torch or onnx."""

import subprocess
import sys

import pytest
from conftest import SPEECH, TINY

FORBIDDEN = ("torch", "onnx", "onnxscript", "transformers", "facecode_exporter")
ANIMATE = f"""
import facecode
face = facecode.load({str(TINY)!r})
face.animate({str(SPEECH)!r}).save("talk.npz")
import facecode.cli, facecode.bench.measure, facecode.cli.info
"""


def loaded_modules(program, cwd):
    """Top-level modules that a fresh interpreter holds after `program`."""
    code = f"{program}\nimport sys\nprint(*sorted({{m.partition('.')[0] for m in sys.modules}}))"
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, cwd=cwd, check=True
    )
    return set(done.stdout.split())


def test_runtime_loads_no_torch(tmp_path):
    assert not loaded_modules(ANIMATE, tmp_path) & set(FORBIDDEN)


def test_spec_is_standard_library_only(tmp_path):
    before = loaded_modules("", tmp_path)
    after = loaded_modules("import facecode_spec.systems, facecode_spec.manifest", tmp_path)
    assert after - before <= set(sys.stdlib_module_names) | {"facecode_spec"}


@pytest.mark.parametrize("module", ["torch", "onnx"])
def test_the_check_can_fail(tmp_path, module):
    assert module in loaded_modules(f"import facecode\nimport {module}", tmp_path)


def test_importing_is_quick_and_lazy(tmp_path):
    lazy = {"onnxruntime", "soundfile", "soxr", "trimesh", "tqdm", "argparse", "av"}
    assert not loaded_modules("import facecode", tmp_path) & (lazy - {"argparse"})
