"""The losses of CDFace: what pulls, what pushes, and where nothing does."""

import math

import numpy as np
import pytest
import torch

from facecode_exporter.measures.openings import open_frames
from facecode_exporter.training.diverse_losses import (
    TERMS,
    DiverseLosses,
    diverse_terms,
    diversity,
    total,
)

K, T, WIDE = 4, 6, 9


@pytest.fixture
def batch():
    """Samples (2, 4, 6, 9) that ask for gradients, truth, and a mouth closed in frames 2 and 3."""
    generator = torch.Generator().manual_seed(0)
    samples = torch.randn(2, K, T, WIDE, generator=generator).requires_grad_()
    truth = torch.randn(2, T, WIDE, generator=generator)
    open_mouth = torch.ones(2, T)
    open_mouth[:, 2:4] = 0
    return samples, truth, open_mouth


def terms_of(batch, **changes):
    samples, truth, open_mouth = batch
    features = features_of(0)
    true_vectors = features_of(1)[:, 0]
    terms = diverse_terms(
        samples, truth, open_mouth, features, features + 0.5, true_vectors, half_at=1.0
    )
    return dict(zip(TERMS, terms, strict=True)) | changes


def features_of(seed):
    return torch.randn(2, K, T, 3, 5, generator=torch.Generator().manual_seed(seed))


def test_closed_frames_carry_no_diversity_force(batch):
    terms_of(batch)["diversity"].backward()
    gradient = batch[0].grad
    assert (gradient[:, :, 2:4] == 0).all()
    assert (gradient[:, :, [0, 1, 4, 5]] != 0).any()


def test_closed_frames_are_pulled_to_the_truth_in_all_samples(batch):
    samples, truth, _ = batch
    terms_of(batch)["closure"].backward()
    gradient = samples.grad
    assert (gradient[:, :, [0, 1, 4, 5]] == 0).all()
    away = (samples - truth[:, None]).detach()[:, :, 2:4]
    pull = gradient[:, :, 2:4] / away
    torch.testing.assert_close(pull, torch.full_like(pull, float(pull.mean())))
    assert pull.mean() > 0


def test_only_the_closest_pair_is_pushed(batch):
    samples = batch[0]
    with torch.no_grad():
        samples[:, 2] = samples[:, 1] + 0.01 * torch.randn(2, T, WIDE)
    diversity(samples, 1.0).backward()
    assert (samples.grad[:, [0, 3]] == 0).all()
    assert (samples.grad[:, [1, 2]] != 0).any()


def test_only_the_best_sample_is_reconstructed(batch):
    samples, truth, _ = batch
    with torch.no_grad():
        samples[:, 3] = truth + 0.1
    terms_of(batch)["reconstruction"].backward()
    assert (samples.grad[:, :3] == 0).all()
    assert (samples.grad[:, 3] != 0).all()


def test_codes_of_the_truth_bind_the_best_sample_and_closed_frames(batch):
    samples, truth, open_mouth = batch
    with torch.no_grad():
        samples[:, 3] = truth + 0.1
    features, true_vectors = features_of(0).requires_grad_(), features_of(1)[:, 0]
    terms = diverse_terms(samples, truth, open_mouth, features, features_of(2), true_vectors, 1.0)
    terms[TERMS.index("target_code")].backward()
    pulled = (features.grad != 0).flatten(3).all(dim=-1)
    assert pulled[:, 3].all()
    assert pulled[:, :3, 2:4].all()
    assert (features.grad[:, :3, [0, 1, 4, 5]] == 0).all()
    pull = features.grad / (features.detach() - true_vectors[:, None])
    pull = pull[pulled]
    torch.testing.assert_close(pull, torch.full_like(pull, float(pull.mean())))


def test_diversity_is_half_where_it_is_said_to_be_and_knows_no_length():
    for n_frames in (1, 7):
        pair = torch.stack([torch.zeros(n_frames, 3), torch.full((n_frames, 3), 0.2)])[None]
        assert float(diversity(pair, 0.2)) == pytest.approx(0.5)
        assert float(diversity(pair, 0.1)) == pytest.approx(math.exp(-4 * math.log(2)))
    assert float(diversity(torch.randn(2, 1, 5, 3), 0.2)) == 0


def test_total_weighs_every_term(batch):
    terms = [t.detach() for t in terms_of(batch).values()]
    losses = DiverseLosses(diversity=2, every_sample=3, closure=4, regulariser=5, target_code=6)
    for n_samples in (5, 15):
        weights = (2 * n_samples, 1, 3, 4, 5, 6)
        want = sum(w * float(t) for w, t in zip(weights, terms, strict=True))
        assert float(total(terms, losses, n_samples)) == pytest.approx(want, rel=1e-5)


def test_an_open_mouth_is_one_that_opens_for_its_subject():
    wide = np.linspace(0, 10, 101)
    small = wide / 10
    masks = open_frames([wide, small, wide], ["a", "b", "a"], 0.15)
    np.testing.assert_array_equal(masks[0], wide > 0.15 * 9.5)
    np.testing.assert_array_equal(masks[0], masks[1])
    assert not open_frames([np.zeros(5)], ["a"], 0.15)[0].any()
