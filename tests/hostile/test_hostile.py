"""Some hundred damaged inputs of every kind; hostile_run.py tries as many as are wanted."""

import pytest
from hostile_run import KINDS, run

QUICK = dict.fromkeys(KINDS, 12) | {"recording": 40, "style": 40}
SLOW_MACHINE_S = 60.0


def test_every_kind_is_tried():
    assert set(QUICK) == set(KINDS)


@pytest.mark.parametrize(
    "kinds",
    [("bundle", "recording", "template", "style"), ("clip", "avatar"), ("config", "checkpoint")],
)
def test_each_is_taken_or_refused_in_one_line(kinds):
    results, failures, _ = run({kind: QUICK[kind] for kind in kinds}, 7, longest_s=SLOW_MACHINE_S)
    assert not failures
    for kind in kinds:
        assert results[kind, "taken"] + results[kind, "refused"] == QUICK[kind]
        assert results[kind, "refused"] > QUICK[kind] // 4


@pytest.mark.parametrize(
    ("trap", "verdict"),
    [
        ("crash", "crash"),
        ("defect", "defect"),
        ("unclear", "unclear"),
        ("noise", "noise"),
        ("outside", "outside"),
        ("outside, unseen by Python", "outside"),
        ("nothing", None),
    ],
)
def test_what_must_not_happen_is_noticed(monkeypatch, trap, verdict):
    monkeypatch.setenv("HOSTILE_TRAP", trap)
    _, failures, _ = run({"trap": 1}, 1, longest_s=SLOW_MACHINE_S)
    assert [failure["verdict"] for failure in failures] == ([verdict] if verdict else [])
