"""Which shape is which face unit, in the spellings that avatars have."""

import re

import pytest
from avatars import ARKIT

from facecode.writers.onto.spelling import LONGEST, Spellings


def snake(name):
    return re.sub(r"(?=[A-Z])", "_", name).lower()


def sided(name, left, right):
    return re.sub("Left$", left, re.sub("Right$", right, name))


def in_front(name):
    for side in ("Left", "Right"):
        if name.endswith(side) and not name.startswith(("jaw", f"mouth{side}")):
            return f"{side[0]}_{name.removesuffix(side)}"
    return name


HABITS = {
    "as it is": lambda n: n,
    "Pascal": lambda n: n[0].upper() + n[1:],
    "snake": snake,
    "SCREAMING_SNAKE": lambda n: snake(n).upper(),
    "kebab": lambda n: snake(n).replace("_", "-"),
    "Words": lambda n: snake(n).replace("_", " ").title(),
    "lower": str.lower,
    "UPPER": str.upper,
    "_L": lambda n: sided(n, "_L", "_R"),
    "_l": lambda n: sided(n, "_l", "_r"),
    ".L": lambda n: sided(n, ".L", ".R"),
    "L": lambda n: sided(n, "L", "R"),
    "_left": lambda n: sided(n, "_left", "_right"),
    "Pascal_Snake_L": lambda n: snake(sided(n, "_L", "_R")).title(),
    "blendShape1.": lambda n: "blendShape1." + n,
    "head_": lambda n: "head_" + n,
    "head_ with _L": lambda n: "head_" + sided(n, "_L", "_R"),
    "VRoid": lambda n: "Face.M_F00_000_00_Fcl_ALL_" + n,
    "Maya": lambda n: "rig:face|bs_node." + n,
    "iClone": lambda n: f"A{ARKIT.index(n) + 1:02d}_{snake(n).title()}",
    "MetaHuman": lambda n: "CTRL_expressions_" + sided(n, "L", "R"),
    "ARKit": lambda n: "ARKit" + n[0].upper() + n[1:],
    "L_ in front": in_front,
}


@pytest.mark.parametrize("habit", HABITS)
def test_every_unit_in_every_habit(habit):
    names = [HABITS[habit](name) for name in ARKIT]
    assert Spellings(ARKIT).assign(names) == {unit: [i] for i, unit in enumerate(ARKIT)}


OTHERS = [
    *("Fcl_MTH_A", "Fcl_EYE_Close_L", "Fcl_ALL_Neutral", "vrc.v_aa", "vrc.blink", "Basis"),
    *("jaw", "mouth", "eyeBlink", "brow_down", "L_mouth", "body_left", "jaw_opener", "xjawopen"),
    *("upper_mouthLeft", "lowerMouthRight", "notJawOpen", "jawOpen_mouthClose"),
    *("JawOpen_corrective", "jawOpenFix", "corrective_jawOpen", "", "1", "_", "あ", "口"),
]


def test_other_shapes_are_no_units():
    assert Spellings(ARKIT).assign([*OTHERS, "jawOpen" * (LONGEST // 7 + 1)]) == {}


def test_the_plain_name_is_taken_before_one_with_a_prefix():
    names = ["teeth_jawOpen", "head_jawOpen", "head_tongueOut", "jawOpen"]
    assert Spellings(ARKIT).assign(names) == {"jawOpen": [3], "tongueOut": [2]}
    assert Spellings(ARKIT).assign(names[:3]) == {"jawOpen": [1], "tongueOut": [2]}


def test_a_unit_in_two_halves_moves_both():
    names = ["browInnerUp_R", "browInnerUp_L", "CheekPuffLeft", "jawOpen", "jawOpen_L"]
    assert Spellings(ARKIT).assign(names) == {
        "browInnerUp": [0, 1],
        "cheekPuff": [2],
        "jawOpen": [3],
    }


def test_units_of_ones_own():
    found = Spellings(["AA", "lip raise", "smile.L"]).assign(["head_aa", "LipRaise", "smile_l"])
    assert found == {"AA": [0], "lip raise": [1], "smile.L": [2]}
