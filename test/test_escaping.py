"""Names of joints and topics are shown as they are, and do nothing."""

from __future__ import annotations

import io

from hypothesis import given
from hypothesis import strategies as st
from matplotlib.figure import Figure
import pytest
from rich.console import Console

from lip_id_ros.errors import printable
from lip_id_ros.evaluation.report.page import for_page
from lip_id_ros.evaluation.report.style import for_plot
from lip_id_ros.evaluation.tables import show, show_lines, Table

HOSTILE = (
    'j[/red]',
    'arm[left]',
    'a$\\frac{$',
    '$x$',
    r'\$5$',
    '\x1b[31mred\x1b]0;title\x07',
    'a\rb\bc',
    'line\nbreak',
    '\u202eright to left',
    '<script>alert(1)</script>',
    'a&b"c',
    '\udcff',
    '\x00',
)


@pytest.mark.parametrize('name', HOSTILE)
def test_a_name_is_drawn_as_text(name: str) -> None:
    figure = Figure()
    panel = figure.subplots()
    panel.set_title(for_plot(name))
    panel.barh([0], [1.0], tick_label=[for_plot(name)])
    figure.savefig(io.BytesIO(), format='svg')
    escaped = for_plot(name)
    # What matplotlib reads as mathematics has an even number of dollars without a backslash.
    assert (escaped.count('$') - escaped.count(r'\$')) == 0


@given(st.text() | st.sampled_from(HOSTILE))
def test_no_control_character_reaches_a_terminal_or_a_page(text: str) -> None:
    for shown in (printable(text), for_page(text)):
        assert shown.isprintable()
        shown.encode()
    assert not {'<', '>', '"'} & set(for_page(text))


@given(st.text(st.characters(categories=['L', 'N', 'P', 'S'])))
def test_ordinary_text_is_shown_as_it_is(text: str) -> None:
    assert printable(text) == text


@pytest.mark.parametrize('terminal', [True, False])
@pytest.mark.parametrize('name', HOSTILE)
def test_tables_and_lines_show_names_whole(name: str, terminal: bool) -> None:
    stream = io.StringIO()
    console = Console(
        file=stream, width=200, force_terminal=terminal, color_system=None, highlight=False
    )
    show(Table(name, ('', name), [(name, '1')]), console)
    show_lines([f'the joint {name} is slow'], console)
    text = stream.getvalue()
    assert f'the joint {printable(name)} is slow' in text
    assert text.count(printable(name)) == 4
