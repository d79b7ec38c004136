"""Robot descriptions: a URDF as it is read, and what is written back into it."""


def is_text(source: str) -> bool:
    """Whether a source is the text of a URDF, and not the name of a file."""
    return source.lstrip().startswith('<')
