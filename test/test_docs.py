"""Links, tests, commands and options that the pages name are there."""

from __future__ import annotations

from pathlib import Path
import re

import pytest

from benchmarks.__main__ import available
from lip_id_ros import __main__ as programs
from lip_id_ros.cli import main
from lip_id_ros.cli.main import VERBS as MODULES

ROOT = Path(__file__).resolve().parents[1]
VERBS = [module.__name__.rpartition('.')[2] for module in MODULES]
PAGES = sorted([*ROOT.glob('*.md'), *(ROOT / 'docs').rglob('*.md')])
SHARED = (ROOT / 'lip_id_ros' / 'nodes' / 'launch_arguments.py').read_text(encoding='utf-8')
TESTS = '\n'.join(
    path.read_text(encoding='utf-8') for path in sorted((ROOT / 'test').rglob('test_*.py'))
)
NEWCOMERS = [
    ROOT / 'README.md',
    *(page for page in PAGES if page.parent.name in ('docs', 'tutorials', 'how-to')),
]
MOST_WORDS = 25
EACH = pytest.mark.parametrize('page', PAGES, ids=lambda page: str(page.relative_to(ROOT)))


def anchors(page: Path) -> set[str]:
    """Return the anchors that GitHub gives the headings of a page."""
    titles = re.findall(r'^#+ (.*)$', page.read_text(encoding='utf-8'), flags=re.MULTILINE)
    plain = (re.sub(r'\[([^]]*)\]\([^)]*\)', r'\1', title).lower() for title in titles)
    return {re.sub(r'[^\w\- ]', '', title).replace(' ', '-') for title in plain}


@EACH
def test_links_lead_somewhere(page: Path) -> None:
    text = re.sub(r'```.*?```', '', page.read_text(encoding='utf-8'), flags=re.DOTALL)
    for link in re.findall(r'\]\(([^)\s]+)\)', text):
        if '://' in link:
            continue
        path, _, anchor = link.partition('#')
        target = (page.parent / path).resolve() if path else page
        assert target.exists(), link
        assert not anchor or anchor in anchors(target), link


@EACH
def test_named_tests_exist(page: Path) -> None:
    for name in set(re.findall(r'`(test_\w+)`', page.read_text(encoding='utf-8'))):
        assert f'def {name}(' in TESTS, name


def test_each_event_of_the_safety_page_is_shown_by_a_test() -> None:
    lines = (ROOT / 'docs' / 'explanation' / 'safety.md').read_text(encoding='utf-8').splitlines()
    rows = [line.strip('| ').split(' | ') for line in lines if line.startswith('| ')]
    events = [row for row in rows if row[0] != 'Event']
    assert len(events) > 40
    for event, *_, shown in events:
        assert TESTS.count(f'def {shown.strip("`")}(') == 1, event


@EACH
def test_named_benchmarks_exist(page: Path) -> None:
    text = page.read_text(encoding='utf-8')
    for name in set(re.findall(r'python -m\s+benchmarks\s+(\w+)', text)):
        assert name in available(), name


@EACH
def test_commands_have_their_options(page: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Of `lip_id`, in blocks and in lines of text."""
    for verb, rest in re.findall(
        r'\blip_id ([a-z]+)\b([^`\n#]*)', page.read_text(encoding='utf-8')
    ):
        if verb not in VERBS:
            continue
        with pytest.raises(SystemExit):
            main([verb, '--help'])
        usage = capsys.readouterr().out
        missing = [option for option in re.findall(r'--[a-z][\w-]*', rest) if option not in usage]
        assert not missing, (verb, rest)


@EACH
def test_nodes_and_launch_files_exist(page: Path) -> None:
    text = page.read_text(encoding='utf-8')
    setup = (ROOT / 'setup.py').read_text(encoding='utf-8')
    for name in re.findall(r'ros2 run lip_id_ros (\w+)', text):
        assert f"'{name}'" in setup, name
        assert callable(getattr(programs, name)), name
    launched = re.findall(r'ros2 launch lip_id_ros (\S+\.launch\.py)((?:[^`\n]|\\\n)*)', text)
    for name, rest in launched:
        launch = ROOT / 'launch' / name
        assert launch.exists(), name
        known = launch.read_text(encoding='utf-8') + SHARED
        for argument in re.findall(r'(\w+):=', rest):
            assert f"'{argument}'" in known, (name, argument)


@EACH
def test_topics_that_are_shown_are_named_with_their_types(page: Path) -> None:
    """Without a type, `ros2 topic echo` ends where it knows no publisher yet."""
    text = page.read_text(encoding='utf-8').replace('\\\n', ' ')
    for shown in re.findall('ros2 topic echo( [^`\n]+)', text):
        assert re.search(r' /[\w/]+ +\w+/msg/\w+', shown), shown


def test_the_readme_is_short() -> None:
    assert len((ROOT / 'README.md').read_text(encoding='utf-8').split()) <= 900


@pytest.mark.parametrize('page', NEWCOMERS, ids=lambda page: str(page.relative_to(ROOT)))
def test_sentences_for_newcomers_are_short(page: Path) -> None:
    text = re.sub(r'\A---.*?---\n|```.*?```', '\n\n', page.read_text('utf-8'), flags=re.DOTALL)
    text = re.sub(r'\]\([^)]*\)', ']', text)
    parts = re.split(r'\n\s*\n|\n(?=[-|*#] |\d\. )|\|', text)
    sentences = [each for part in parts for each in re.split(r'(?<=[.?!:;])\s+', part)]
    assert [each for each in sentences if len(each.split()) > MOST_WORDS] == []


@pytest.mark.parametrize('folder', ['lip_id_ros', 'benchmarks', 'config', 'scripts'])
def test_pages_that_sources_name_exist(folder: str) -> None:
    names = {page.name for page in PAGES}
    for path in (ROOT / folder).rglob('*.*'):
        if path.suffix in ('.py', '.yaml', '.sh', '.in'):
            named = re.findall(r'[\w./-]*\w\.md\b', path.read_text(encoding='utf-8'))
            missing = [page for page in named if page not in names and not (ROOT / page).exists()]
            assert not missing, path
