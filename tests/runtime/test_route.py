"""Which modules a run enters: few, so that a reader can follow one recording through the code.

Counted on real runs with a profile hook: a module is entered when a function of it is called. It is
returned to when a call enters it again out of another module than the ones before it did.
"""

import sys
from collections import defaultdict
from pathlib import Path

import pytest
from conftest import SPEECH

import facecode
from facecode.bundle import PACKAGED_BUNDLE

ROOT = Path(facecode.__file__).parent


def route(run):
    """Modules in the order of their first call, and for each the modules that calls came from."""
    last, order, sources = None, [], defaultdict(list)

    def hook(frame, event, _):
        nonlocal last
        file = Path(frame.f_code.co_filename)
        if event != "call" or ROOT not in file.parents:
            return
        module = str(file.relative_to(ROOT).with_suffix(""))
        if module != last:
            if module not in sources:
                order.append(module)
            if last not in sources[module]:
                sources[module].append(last)
        last = module

    sys.setprofile(hook)
    try:
        run()
    finally:
        sys.setprofile(None)
    return order, sources


@pytest.fixture(scope="module")
def face():
    return facecode.load(PACKAGED_BUNDLE)


@pytest.mark.parametrize(("mode", "most"), [("exact", 9), ("window", 10)])
def test_animate_enters_few_modules(face, mode, most):
    order, sources = route(lambda: face.animate(SPEECH, mode=mode))
    assert len(order) <= most, order
    assert order[0] == "animator"
    assert len(sources["animator"]) - 1 <= 2, sources["animator"]


def test_to_a_file_enters_four_more(face, tmp_path):
    order, _ = route(lambda: face.animate(SPEECH).save(tmp_path / "talk.npz"))
    assert len(order) <= 13, order
