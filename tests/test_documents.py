"""Shell and Python blocks of README and docs: run here, or marked why not; links lead to files."""

import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", ROOT / "SECURITY.md"]
PAGES += sorted((ROOT / "docs").rglob("*.md"))
BLOCK = re.compile(
    r"(?:<!-- (?P<mark>[^\n]*) -->\n)?```(?P<kind>sh|python)\n(?P<code>.*?)```", re.S
)
BLOCKS = [
    pytest.param(match, id=f"{page.name}-{i}")
    for page in PAGES
    for i, match in enumerate(BLOCK.finditer(page.read_text()))
]
PROGRAMS = {"facecode": "facecode.cli.main", "facecode-export": "facecode_exporter.cli.main"}


@pytest.mark.parametrize("block", [b for b in BLOCKS if b.values[0]["kind"] == "python"])
def test_python_blocks(block, tmp_path):
    if (block["mark"] or "").startswith("not run: "):
        return
    said = re.findall(r"print\(.*# (.*)", block["code"])
    done = subprocess.run(
        [sys.executable, "-c", block["code"]], cwd=tmp_path, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.splitlines() == said


@pytest.mark.parametrize("block", [b for b in BLOCKS if b.values[0]["kind"] == "sh"])
def test_shell_blocks_name_options_that_exist(block):
    """Commands of facecode are parsed by its own parsers; the marked ones run in `.ci/run`."""
    import importlib

    if (block["mark"] or "").startswith("not run: "):
        return
    for line in block["code"].replace("\\\n", " ").splitlines():
        words = shlex.split(line, comments=True)
        name = Path(words[0]).name if words else ""
        if name in PROGRAMS and "|" not in words:
            importlib.import_module(PROGRAMS[name]).parse_args(words[1:])


def test_links_lead_to_files():
    for page in PAGES:
        for link in re.findall(r"\]\((?!http)([^)#]+)\)", page.read_text()):
            assert (page.parent / link).exists(), f"{page.name}: {link}"


@pytest.mark.parametrize("program", PROGRAMS)
def test_every_option_is_explained(program, monkeypatch, capsys):
    """`--help` of every command: no option without words."""
    import argparse
    import importlib

    module = importlib.import_module(PROGRAMS[program])
    bare = []
    add = argparse._ActionsContainer.add_argument

    def checked(self, *names, **options):
        if options.get("action") != "help" and not options.get("help"):
            bare.append(names)
        return add(self, *names, **options)

    monkeypatch.setattr(argparse._ActionsContainer, "add_argument", checked)
    with pytest.raises(SystemExit):
        module.parse_args(["--version"])
    bare = [names for names in bare if names not in {("--version",), ("-h", "--help")}]
    assert not bare


def test_extras_are_installed_from_a_clone():
    """The name on the package index is not ours: every line that installs says where from."""
    lines = [line for page in PAGES for line in page.read_text().splitlines()]
    sources = (ROOT / "runtime").rglob("*.py")
    lines += [line for file in sources for line in file.read_text().splitlines()]
    assert not [line for line in lines if re.search(r"pip install '?facecode\b", line)]


@pytest.mark.parametrize(
    ("program", "command", "words"),
    [
        ("facecode", "", "facecode demo"),
        ("facecode", "animate", "--samples 5"),
        ("facecode", "animate", "default: the bundle's first"),
        ("facecode-export", "export", "smallest code margin"),
        ("facecode-export", "export", "the public .pth.tar"),
        ("facecode-export", "train", "templates.pkl"),
    ],
)
def test_help_answers_a_newcomer(program, command, words, capsys):
    import importlib

    with pytest.raises(SystemExit):
        importlib.import_module(PROGRAMS[program]).parse_args([*command.split(), "--help"])
    assert words in " ".join(capsys.readouterr().out.split())


def test_test_systems_are_taken_and_not_offered(capsys):
    from facecode_exporter.cli.main import parse_args

    assert parse_args(["init", "--system", "cdface-tiny", "--out", "x"]).system == "cdface-tiny"
    with pytest.raises(SystemExit):
        parse_args(["init", "--system", "nosuch", "--out", "x"])
    err = capsys.readouterr().err
    assert "codetalker-vocaset" in err
    assert "tiny" not in err
