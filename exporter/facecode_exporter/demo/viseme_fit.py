"""Fit the visemes of the rules to tracked speech: shapes, dominance and moments.

Comes in: a folder of tracked people. Goes out: what `corpus/visemes.json` holds. The model is that
of `corpus.mouth`, differentiable: at each frame the shapes of all sounds are averaged by their
dominance (Cohen and Massaro 1993). Adam takes the squared differences of the measures of the mouth
down from the visemes chosen by hand; a sound that is never said keeps those. Nothing but the
training clips is looked at.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import Tensor

from facecode_exporter.corpus.mouth import TYPICAL_DB
from facecode_exporter.corpus.prosody import frame_times
from facecode_exporter.corpus.rules import FPS
from facecode_exporter.corpus.visemes import (
    BY_HAND,
    FULL_SILENCE_S,
    JAW,
    LIPS,
    LOUDEST_GAIN,
    QUIETEST_GAIN,
    Timing,
    Viseme,
    articulator,
)
from facecode_exporter.demo.spoken import UNITS, Spoken, column_of, read_spoken
from facecode_exporter.head.face_units import unit_weights
from facecode_exporter.head.head import load_head
from facecode_exporter.head.mouth_fit import unit_measures
from facecode_exporter.measures.phone import SILENCE

COUNTS_ALIKE_MM = (1.0, 1.5, 1.0, 1.5, 2.0, 1.5, 4.0)
"""Of the measures of `head.mouth_fit`."""
STEPS = 300
RATES = {"shape": 0.05, "dominance": 0.02, "late": 0.002, "reach": 0.02, "rest": 0.005}
SELDOM = 100
"""A sound said this often is half bound to its viseme by hand."""
SHY = {"mouthRollLower": "FVPBM", "mouthShrugLower": "", "mouthShrugUpper": "", "mouthFrown": ""}
"""Units that only the sounds named may use freely."""
TOUCHING_MM = 0.5
"""Lips may overlap by so much; further on the head they would pass through each other."""
FIRMER_SILENCE = 5.0
"""The speaker parts his lips long before he speaks; generated speech rests in its silences."""
SMALLEST = 0.03
"""Weights below it are left out of a shape."""
ARTICULATORS = (JAW, LIPS)


class VisemeFit(torch.nn.Module):
    """Visemes as parameters, from those by hand."""

    def __init__(self) -> None:
        super().__init__()
        hand = [BY_HAND[name] for name in BY_HAND]
        columns = [column_of(unit) for unit in UNITS]
        self.shape_by_hand = torch.tensor(np.stack([v.shape[columns] for v in hand]))
        strength = torch.tensor([[v.dominance[a] for a in ARTICULATORS] for v in hand]).log()
        self.dominance_by_hand = strength
        self.shape = torch.nn.Parameter(self.shape_by_hand.clamp(0.02, 0.98).logit())
        self.dominance = torch.nn.Parameter(strength.clone())
        self.late = torch.nn.Parameter(torch.zeros(len(hand)))
        self.reach = torch.nn.Parameter(torch.full((len(ARTICULATORS), 2), 0.06).log())
        self.plateau = torch.nn.Parameter(torch.tensor(0.3).logit())
        self.jaw_per_db = torch.nn.Parameter(torch.tensor(0.04))
        self.along = torch.from_numpy(unit_measures(load_head())).float()
        self.silent = torch.tensor([name == SILENCE for name in BY_HAND])
        self.of = torch.tensor([ARTICULATORS.index(articulator(unit)) for unit in UNITS])

    def shapes(self) -> Tensor:
        """(n_visemes, 15); silence is the neutral face."""
        return self.shape.sigmoid() * (~self.silent)[:, None]

    def strengths(self) -> Tensor:
        """(n_visemes, 2); silence keeps the hand's, or the mouth would stay open in pauses."""
        free = (~self.silent)[:, None]
        return torch.where(free, self.dominance, self.dominance_by_hand).exp()

    def forward(self, said: Spoken) -> Tensor:
        """(n, T, 15) weights."""
        times = torch.from_numpy(frame_times(said.measures.shape[1], FPS))[None, :, None]
        louder = (1 + (said.level_db - TYPICAL_DB) * self.jaw_per_db)[..., None]
        gain = louder.clamp(QUIETEST_GAIN, LOUDEST_GAIN)
        targets = self.shapes()[said.sounds] * torch.where(self.of == 0, gain, 1.0)
        length, silent = said.end_s - said.start_s, self.silent[said.sounds]
        plateau = torch.where(silent, 0.5, self.plateau.sigmoid()) * length
        middle = (said.start_s + said.end_s) / 2 + self.late[said.sounds] * ~silent
        away = times - middle[:, None]
        beyond = (away.abs() - plateau[:, None]).clamp(min=0)
        weights = torch.zeros(*said.measures.shape[:2], len(UNITS))
        for k in range(len(ARTICULATORS)):
            strength = self.strengths()[said.sounds, k] * said.present
            strength = strength * torch.where(silent, (length / FULL_SILENCE_S).clamp(max=1), 1.0)
            before, after = self.reach[k].exp()
            reach = torch.where(away < 0, before, after)
            faded = torch.exp(-((beyond / reach + 1e-6) ** 1.3)).clamp(min=1e-9)
            share = faded * strength[:, None]
            share = share / share.sum(dim=2, keepdim=True)
            weights[..., self.of == k] = share @ targets[..., self.of == k]
        return weights

    def reluctance(self, counts: Tensor) -> Tensor:
        """What keeps seldom said sounds near the hand's, and shapes small and plain."""
        shapes = self.shape.sigmoid()
        bound = (shapes - self.shape_by_hand).square() / (1 + counts / SELDOM)[:, None]
        shy = torch.tensor(
            [[1.0 * (u in SHY and name not in SHY[u]) for u in UNITS] for name in BY_HAND]
        )
        overlap = (-(self.shapes() @ self.along)[:, 0] - TOUCHING_MM).clamp(min=0)
        return (
            0.05 * bound.sum(dim=1).mean()
            + ((0.02 + shy) * shapes.square()).sum(dim=1).mean()
            + 0.01 * (self.dominance - self.dominance_by_hand).square().mean()
            + 20 * self.late.square().mean()
            + 0.1 * overlap.square().mean()
        )

    def visemes(self, counts: Mapping[str, int]) -> dict[str, Viseme]:
        """Those of sounds that were said, and the hand's for the others."""
        shapes, found = self.shapes().detach().numpy(), dict(BY_HAND)
        for i, (name, hand) in enumerate(BY_HAND.items()):
            if not counts.get(name):
                continue
            shape = hand.shape.copy()
            for unit, weight in zip(UNITS, shapes[i], strict=True):
                shape[unit_weights(**{unit: 1.0}) > 0] = weight if weight > SMALLEST else 0
            firmer = FIRMER_SILENCE if self.silent[i] else 1.0
            strength = (firmer * self.strengths()[i]).tolist()
            dominance = dict(hand.dominance) | dict(zip(ARTICULATORS, strength, strict=True))
            found[name] = Viseme(shape, dominance, 0.0 if self.silent[i] else self.late[i].item())
        return found

    def timing(self) -> Timing:
        """How far sounds reach; the tongue's stays."""
        before_after = self.reach.exp().tolist()
        reach = {a: tuple(r) for a, r in zip(ARTICULATORS, before_after, strict=True)}
        plain = Timing.by_hand()
        return Timing(
            {**plain.reach_s, **reach}, self.plateau.sigmoid().item(), self.jaw_per_db.item()
        )


def fit_visemes(data: Path, progress: bool = True) -> tuple[dict[str, Viseme], Timing]:
    """Visemes and timing that follow the training clips of `data`. Deterministic.

    Raises:
        DataSetError: files that are missing or of another form.
    """
    from tqdm import trange

    torch.manual_seed(0)
    said, counts = read_spoken(data, "train", load_head())
    number = torch.tensor([float(counts[name]) for name in BY_HAND])
    alike = torch.tensor(COUNTS_ALIKE_MM)
    fit = VisemeFit()
    groups: list[dict[str, Any]] = [
        {"params": [fit.shape], "lr": RATES["shape"]},
        {"params": [fit.dominance], "lr": RATES["dominance"]},
        {"params": [fit.late], "lr": RATES["late"]},
        {"params": [fit.reach], "lr": RATES["reach"]},
        {"params": [fit.plateau, fit.jaw_per_db], "lr": RATES["rest"]},
    ]
    adam = torch.optim.Adam(groups)
    for _ in trange(STEPS, desc="visemes", disable=not progress):
        wrong = fit(said) - said.weights
        loss = (wrong @ fit.along / alike).square().mean() + 0.5 * wrong.square().mean()
        adam.zero_grad()
        torch.autograd.backward(loss + fit.reluctance(number))
        adam.step()
    return fit.visemes(counts), fit.timing()
