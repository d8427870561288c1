"""Sentences: varied, reproducible, and each in one split only."""

import re

import numpy as np

from facecode_exporter.corpus.prompts import sentence
from facecode_exporter.corpus.utterance import SPLITS, sentence_split, split_of


def sentences(seed, n=400, vocabulary=()):
    rng = np.random.default_rng(seed)
    return [sentence(rng, vocabulary) for _ in range(n)]


def test_the_same_seed_gives_the_same_sentences():
    assert sentences(3) == sentences(3)
    assert sentences(3) != sentences(4)


def test_sentences_differ_and_end_as_sentences():
    made = sentences(0)
    assert len(set(made)) > 250
    assert all(re.fullmatch(r"[A-Z][A-Za-z ',.?!]*[.?!]", text) for text in made)
    assert sum("?" in text for text in made) > 20 < sum("!" in text for text in made)


def test_labials_are_frequent():
    made = sentences(1)
    assert np.mean([len(re.findall("[pbmfv]", text.lower())) >= 3 for text in made]) > 0.6


def test_word_lists_use_the_vocabulary():
    made = sentences(0, vocabulary=("zebra", "azure"))
    lists = [t for t in made if set(re.findall("[a-z]+", t.lower())) <= {"zebra", "azure"}]
    assert 0.1 < len(lists) / len(made) < 0.35


def test_eight_of_ten_are_for_training():
    splits = [split_of(number) for number in range(1000)]
    assert [splits.count(split) for split in SPLITS] == [800, 100, 100]


def test_a_sentence_belongs_to_one_split_and_every_split_has_sentences():
    assert sentence_split("Stop.") == sentence_split("Stop.")
    assert {sentence_split(text) for text in sentences(2)} == set(SPLITS)
