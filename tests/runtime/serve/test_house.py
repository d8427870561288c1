"""What sessions share."""

import pytest
from conftest import TINY

import facecode
from facecode.errors import NoRigError

pytest.importorskip("starlette")

from facecode.serve.heads import Heads
from facecode.serve.house import House
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
