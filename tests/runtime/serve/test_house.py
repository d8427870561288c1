"""What sessions share."""

import pytest
from conftest import TINY

import facecode
from facecode.errors import NoRigError
from facecode.live import primed

pytest.importorskip("starlette")

from facecode.serve.heads import Heads
from facecode.serve.house import PRIMED_STYLES, House
from facecode.serve.limits import Limits


def test_a_face_without_units_has_nothing_to_send():
    with pytest.raises(NoRigError, match="face units"):
        House(facecode.load(TINY, threads=1), Limits(1), 1)


def test_places():
    house = House(facecode.load(threads=1), Limits(1), 1)
    with house.place() as first, house.place() as second:
        assert (first, second) == (True, False)
        assert house.metrics.sessions == 1
    with house.place() as again:
        assert again


def test_heads_are_made_once():
    heads = Heads(facecode.load(threads=1), "african-male-young")
    assert heads.get(None) is heads.get(None)
    assert heads.get(None) == heads.get("african-male-young")
    assert heads.get("nobody") is None


def test_the_past_of_every_style_is_animated_before_a_client_comes(monkeypatch):
    face = facecode.load(threads=1)
    House(face, Limits(1), 1)

    def never(*_):
        raise AssertionError("primed for a client")

    monkeypatch.setattr(primed, "LiveLoop", never)
    for style in face.styles[:PRIMED_STYLES]:
        face.stream(style, rest_in_quiet=True)
    with pytest.raises(AssertionError):
        face.stream(look_ahead_ms=400)
