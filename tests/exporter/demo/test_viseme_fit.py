"""The fit's model is that of the rules, and it learns."""

import json

import numpy as np
import pytest
import torch
from tracked_mouths import write_mouth_tracks

from facecode_exporter.corpus import mouth
from facecode_exporter.corpus.styles import Style
from facecode_exporter.corpus.visemes import BY_HAND, from_json
from facecode_exporter.demo import viseme_fit
from facecode_exporter.demo.spoken import UNITS, column_of, read_spoken
from facecode_exporter.demo.viseme_fit import VisemeFit, fit_visemes
from facecode_exporter.head.head import load_head
from facecode_exporter.measures.phone import Phone


@pytest.fixture(scope="module")
def people(tmp_path_factory, speech):
    folder = tmp_path_factory.mktemp("people")
    write_mouth_tracks(folder, 4, *speech)
    return folder


def test_it_computes_what_the_rules_compute(people, monkeypatch):
    monkeypatch.setattr(viseme_fit, "SMALLEST", 0.0)
    monkeypatch.setattr(viseme_fit, "FIRMER_SILENCE", 1.0)
    said, _ = read_spoken(people, "train", load_head())
    fit = VisemeFit()
    generator = torch.Generator().manual_seed(0)
    with torch.no_grad():
        for parameter in (fit.shape, fit.dominance, fit.late, fit.reach):
            step = 0.02 if parameter is fit.late else 0.3
            parameter += step * torch.randn(parameter.shape, generator=generator)
        fit.jaw_per_db.zero_()
        expected = fit(said)[0].numpy()
    monkeypatch.setattr(mouth, "VISEMES", fit.visemes(dict.fromkeys(BY_HAND, 1)))
    monkeypatch.setattr(mouth, "TIMING", fit.timing())
    names = list(BY_HAND)
    phones = [
        Phone(names[number], start, end)
        for number, start, end, there in zip(
            said.sounds[0].tolist(),
            said.start_s[0].tolist(),
            said.end_s[0].tolist(),
            said.present[0].tolist(),
            strict=True,
        )
        if there
    ]
    without_contact = [p if p.name != "P" else Phone("K", *p[1:]) for p in phones]
    monkeypatch.setitem(mouth.VISEMES, "K", mouth.VISEMES["P"])
    quiet = np.full(len(expected), -3, np.float32)
    found = mouth.mouth_weights(without_contact, quiet, Style("plain", blur=1.0), 30.0)
    assert np.abs(found[:, [column_of(unit) for unit in UNITS]] - expected).max() < 1e-5
    assert expected.max() > 0.3


def test_it_comes_nearer_and_keeps_what_is_not_said(people, monkeypatch):
    monkeypatch.setattr(viseme_fit, "STEPS", 40)
    said, _ = read_spoken(people, "train", load_head())
    with torch.no_grad():
        before = (VisemeFit()(said) - said.weights).square().mean().item()
    visemes, timing = fit_visemes(people, progress=False)
    again, _ = fit_visemes(people, progress=False)
    assert all(np.array_equal(visemes[name].shape, again[name].shape) for name in visemes)
    assert visemes["IY"] is BY_HAND["IY"]
    assert not np.array_equal(visemes["AA"].shape, BY_HAND["AA"].shape)
    fit = VisemeFit()
    with torch.no_grad():
        for name in ("AA", "P"):
            shape = torch.from_numpy(visemes[name].shape[[column_of(u) for u in UNITS]])
            fit.shape[list(BY_HAND).index(name)] = shape.clamp(1e-3, 1 - 1e-3).logit()
        after = (fit(said) - said.weights).square().mean().item()
    assert after < before
    assert timing.reach_s["tongue"] == (0.04, 0.04)


def test_at_the_command_line(people, tmp_path, monkeypatch):
    from facecode_exporter.cli.main import main

    monkeypatch.setattr(viseme_fit, "STEPS", 2)
    out = tmp_path / "visemes.json"
    assert main(["fit-visemes", "--data", str(people), "--out", str(out), "--quiet"]) == 0
    visemes, _ = from_json(json.loads(out.read_text()))
    assert visemes.keys() == BY_HAND.keys()
    nowhere = tmp_path / "no" / "visemes.json"
    assert main(["fit-visemes", "--data", str(people), "--out", str(nowhere), "--quiet"]) == 2
