"""Frames of a closed mouth count more where the configuration says so."""

import dataclasses

import numpy as np
import pytest
import torch
from conftest import DATA, make_folder

from facecode_exporter.config import system_from_config
from facecode_exporter.data.clips import FolderClips, FolderPart
from facecode_exporter.data.data_set import LAYOUTS
from facecode_exporter.nets.codetalker import CodeTalker
from facecode_exporter.training.config import stage2_defaults
from facecode_exporter.training.losses import counted_mse
from facecode_exporter.training.stage2 import Stage2

CASE = DATA / "codetalker-vocaset-tiny"


@pytest.fixture(scope="module")
def stage(tmp_path_factory):
    """Of a weight of closed frames."""
    root = make_folder(tmp_path_factory.mktemp("closed") / "data", "vocaset", 120)
    system = system_from_config(CASE / "config.yaml", CASE / "wav2vec2.json")
    system = dataclasses.replace(system, styles=LAYOUTS["vocaset"].seen)
    clips = FolderPart(FolderClips(root, "vocaset", "train", system), np.arange(120), (1, 3))
    config = stage2_defaults(system.name, "data")

    def make(weight):
        net = CodeTalker(system)
        return Stage2(net, clips, clips, dataclasses.replace(config, closed_weight=weight))

    return make


def test_frames_count_as_often_as_they_are_said_to():
    said, truth = torch.randn(2, 5, 4, 3), torch.randn(2, 5, 4, 3)
    error = (said - truth).square().mean(dim=(2, 3))
    counts = torch.tensor([[1.0, 3, 1, 1, 3], [1, 1, 1, 1, 1]])
    repeated = torch.cat([error.flatten(), *[error[0, [1, 4]]] * 2])
    torch.testing.assert_close(counted_mse(said, truth, counts), repeated.mean())
    mean = torch.nn.functional.mse_loss(said, truth)
    torch.testing.assert_close(counted_mse(said, truth, torch.ones(2, 5)), mean)


def test_closed_frames_weigh_more_in_both_terms(stage):
    plain, closing = stage(1.0), stage(4.0)
    closing.net.load_state_dict(plain.net.state_dict())
    is_open = closing.open["train"][0]
    assert 0 < is_open.sum() < len(is_open)
    group = [(0, 0, len(is_open))]
    for start, n in ((0, len(is_open)), (3, 7)):
        counts = closing._counts("train", [(0, start, n)])
        np.testing.assert_array_equal(counts[0], np.where(is_open[start : start + n], 1, 4))
    with torch.no_grad():
        for net in (plain.net, closing.net):
            net.eval()
        before, after = plain._terms("train", group), closing._terms("train", group)
    assert all(float(a) != pytest.approx(float(b)) for a, b in zip(after, before, strict=True))
