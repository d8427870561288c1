"""What other libraries say, on a line of ours."""

import pytest

from facecode.wording import one_line


@pytest.mark.parametrize(
    ("said", "line"),
    [
        (ValueError("a\n  b"), "a b"),
        (KeyError(), "KeyError"),
        ("x\x1b[1m\u202e", "x\\x1b[1m\\u202e"),
        ("y" * 400, "y" * 300 + "..."),
    ],
)
def test_one_line(said, line):
    assert one_line(said) == line
