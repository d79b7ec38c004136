r"""
Escape names of joints and topics, which are data, for terminals, plots and web pages.

`$` begins mathematics in a plot, `[` markup in a terminal, `<` a tag on a page, and control
characters move a cursor.
"""

import errno
import html

REMEDIES = {errno.ENOENT: '; correct the path.', errno.ENOSPC: '; free that disk.'}
"""Of errors of the file system, by their numbers."""


def printable(text: str) -> str:
    r"""Return text for a terminal or a log: control and unassigned characters as escapes."""
    return ''.join(
        each if each.isprintable() else each.encode('unicode_escape', 'surrogatepass').decode()
        for each in text
    )


def one_line(error: Exception) -> str:
    """Return the message of an error as one line; one of the file system names the file."""
    if isinstance(error, OSError) and error.filename is not None and error.strerror:
        remedy = REMEDIES.get(error.errno or 0, '')
        return printable(f'{error.filename}: {error.strerror}{remedy}')
    return printable(' '.join(str(error).split()))


def for_plot(text: str) -> str:
    """Return text that matplotlib draws as it is, without reading mathematics into it."""
    return printable(text).replace('$', r'\$')


def for_page(text: str) -> str:
    """Return text that a browser shows as it is."""
    return html.escape(printable(text))
