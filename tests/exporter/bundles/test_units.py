"""`facecode-export export --units --regions --lip-pair`: a rig for a head that comes with none."""

import numpy as np
import pytest

import facecode
from facecode.errors import NoRigError
from facecode_exporter.bundles.units import read_units
from facecode_exporter.cli.main import main
from facecode_exporter.errors import UnitsError

NAMES = ["jawOpen", "mouthSmileLeft", "of my own"]


def units(path, n_vertices, names=NAMES, **changes):
    deltas = np.random.default_rng(0).standard_normal((len(NAMES), n_vertices, 3)) / 100
    np.savez(path, **{"names": np.array(names), "deltas": deltas, **changes})
    return deltas.astype(np.float32)


@pytest.mark.parametrize("precision", ["fp32", "int8"])
def test_a_bundle_gets_its_rig(vocaset_golden, tmp_path, precision):
    n = len(np.load(vocaset_golden.template))
    deltas = units(tmp_path / "units.npz", n)
    (tmp_path / "lips.txt").write_text("3, 4, 5")
    out = tmp_path / "bundle"
    options = ["--units", tmp_path / "units.npz", "--lip-pair", "3,5"]
    options += ["--regions", f"lips={tmp_path / 'lips.txt'}", "--precision", precision]
    options += ["--any-deviation"]
    assert main([*vocaset_golden.export_args(out), *map(str, options)]) == 0
    face = facecode.load(out)
    assert face.bundle.rig.names == tuple(NAMES)
    np.testing.assert_array_equal(face.bundle.rig.deltas, deltas)
    np.testing.assert_array_equal(face.bundle.region("lips"), [3, 4, 5])
    clip = face.animate(vocaset_golden.speech)
    assert clip.lip_pair == (3, 5)
    alone = face.animate(vocaset_golden.speech, vertices=False)
    np.testing.assert_array_equal(alone.codes, clip.codes)
    if precision == "fp32":
        np.testing.assert_allclose(alone.weights, clip.weights, atol=1e-5)
    else:  # the vertex head rounds to int8, the products do not
        assert np.abs(alone.weights - clip.weights).mean() < 0.02
    clip.save(tmp_path / "talk.csv")


def test_without_units_the_option_is_named(golden_bundle, golden, tmp_path):
    clip = facecode.load(golden_bundle).animate(golden.speech)
    with pytest.raises(NoRigError, match=r"--units FILE\.npz"):
        clip.save(tmp_path / "talk.csv")


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"deltas": np.ones((3, 7, 3))}, r"deltas float64 \(3, 7, 3\); expected \(3, 9, 3\)"),
        ({"deltas": np.ones((2, 9, 3))}, r"expected \(3, 9, 3\)"),
        ({"deltas": np.ones((3, 27))}, r"expected \(3, 9, 3\)"),
        ({"deltas": np.full((3, 9, 3), np.nan)}, "not finite"),
        ({"deltas": np.zeros((3, 9, 3))}, "all 0"),
        ({"deltas": np.full((3, 9, 3), "a")}, "of numbers"),
        ({"names": np.arange(3)}, "expected .* of text"),
        ({"names": np.array("jawOpen")}, "expected .* of text"),
        ({"names": np.array(["a", "a", "b"])}, "unlike"),
        ({"names": np.array(["a", "", "b"])}, "unlike"),
        ({"names": np.array(["a", "b", None], object)}, "cannot be read"),
    ],
)
def test_units_that_do_not_fit(tmp_path, changes, words):
    units(tmp_path / "units.npz", 9, **changes)
    with pytest.raises(UnitsError, match=words):
        read_units(tmp_path / "units.npz", 9)


@pytest.mark.parametrize("content", [b"", b"PK", b"names"])
def test_files_that_hold_no_units(tmp_path, content):
    (tmp_path / "units.npz").write_bytes(content)
    with pytest.raises(UnitsError, match="cannot be read"):
        read_units(tmp_path / "units.npz", 9)
    with pytest.raises(UnitsError, match="no face units at"):
        read_units(tmp_path / "none.npz", 9)


def test_mistakes_at_the_command_line(vocaset_golden, tmp_path, capsys):
    n = len(np.load(vocaset_golden.template))
    args = vocaset_golden.export_args(tmp_path / "bundle")
    (tmp_path / "lips.txt").write_text(f"3, {n}")
    units(tmp_path / "other.npz", n + 1)
    for option, words in (
        (["--lip-pair", f"3,{n}"], f"the lip pair names vertex {n}; the mesh has {n}"),
        (["--regions", f"lips={tmp_path / 'lips.txt'}"], f"the lips names vertex {n}"),
        (["--units", str(tmp_path / "other.npz")], f"expected (3, {n}, 3)"),
    ):
        assert main([*args, *option]) == 2
        assert words in capsys.readouterr().err
    for option in (["--regions", "nose=x"], ["--regions", "lips"], ["--lip-pair", "3"]):
        with pytest.raises(SystemExit):
            main([*args, *option])
    assert not (tmp_path / "bundle").exists()
