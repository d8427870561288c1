"""A trained system to a bundle: written to a temporary folder, verified, then renamed."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Literal, TypeAlias

from tqdm import tqdm

from facecode.animator import Animator
from facecode.bundle import Bundle
from facecode.loop.engine import Engine
from facecode_exporter.bundles import parity
from facecode_exporter.bundles.deviation import (
    Motion,
    choose_window,
    deviation,
    move,
    require_small,
)
from facecode_exporter.bundles.graph_set import graph_set
from facecode_exporter.bundles.manifest import LICENCE, files_of, manifest_of, write_arrays
from facecode_exporter.bundles.neutral import Neutral
from facecode_exporter.bundles.onnx_export import export_graph
from facecode_exporter.bundles.parity_cases import parity_cases
from facecode_exporter.bundles.quantize import quantise_file
from facecode_exporter.nets.networks import Network
from facecode_exporter.nets.speech import family_of
from facecode_exporter.output_folder import replacing
from facecode_spec.manifest import MANIFEST_NAME, Manifest, ParityReport

Precision: TypeAlias = Literal["fp32", "int8"]


def write_bundle(
    net: Network,
    out: Path,
    neutral: Neutral,
    sources: Mapping[str, Path],
    progress: bool = False,
    licence: str = LICENCE,
    precision: Precision = "fp32",
    any_deviation: bool = False,
) -> Manifest:
    """Export `net` to the folder `out`; on any failure `out` is as it was before.

    Raises:
        OutputExistsError, OutputFolderError, ParityError.
        DeviationError: int8 changes the motion too much, unless `any_deviation`.
    """
    with (
        replacing(out, MANIFEST_NAME) as folder,
        tqdm(total=len(graph_set(net.system)) + 2, desc="export", disable=not progress) as bar,
    ):
        for graph in graph_set(net.system):
            bar.set_postfix_str(graph.file)
            export_graph(graph.view(net), graph.spec, folder / graph.file)
            bar.update()
        write_arrays(net, folder, neutral)
        manifest = manifest_of(net, folder, neutral, sources, licence)
        _write_manifest(folder, manifest)
        bar.set_postfix_str("parity")
        manifest = replace(manifest, parity=check_bundle(net, folder))
        bar.update()
        bar.set_postfix_str("deviation")
        _write_manifest(folder, manifest)
        exact = move(Animator(Bundle.open(folder)))
        if precision == "int8":
            manifest, exact = _quantise(folder, manifest, exact, any_deviation)
        if "window" in manifest.modes:
            window = choose_window(Animator(Bundle.open(folder)), exact)
            manifest = replace(manifest, modes={**manifest.modes, "window": window})
        _write_manifest(folder, manifest)
        bar.update()
    return manifest


def _quantise(
    folder: Path, manifest: Manifest, exact: Motion, any_deviation: bool
) -> tuple[Manifest, Motion]:
    """Give the graphs of a float32 bundle int8 weights; `exact` is its motion.

    Raises:
        DeviationError
    """
    for graph in graph_set(manifest.system):
        quantise_file(folder / graph.file, family_of(manifest.system).kept_float)
    manifest = replace(manifest, precision="int8", files=files_of(folder))
    _write_manifest(folder, manifest)
    animator = Animator(Bundle.open(folder))
    motion = move(animator)
    found = deviation(animator, exact, motion)
    if not any_deviation:
        require_small(found)
    return replace(manifest, quantisation=found), motion


def check_bundle(net: Network, folder: Path) -> ParityReport:
    """Reopen the bundle with the runtime and compare it with torch.

    Raises:
        ParityError
    """
    engine = Animator(Bundle.open(folder)).engine
    errors = compare_all_graphs(net, engine)
    cases = [parity.compare_clip(net, engine, case) for case in parity_cases(net)]
    parity.require_parity(cases)
    return parity.report(errors, cases)


def compare_all_graphs(net: Network, engine: Engine) -> dict[str, float]:
    """Largest difference to torch of every output of every graph.

    Raises:
        ParityError
    """
    graphs = graph_set(net.system)
    return parity.compare_graphs([(g.spec, g.view(net), g.loaded(engine)) for g in graphs])


def _write_manifest(folder: Path, manifest: Manifest) -> None:
    (folder / MANIFEST_NAME).write_text(manifest.to_json(), encoding="utf-8")
