"""HTML as values: what is text is escaped, so nothing that a mission or a robot says can become markup."""

from html import escape


class Markup(str):
    """Text that is HTML already."""

    __slots__ = ()


def join(*parts: str) -> Markup:
    """Return parts one after another; those that are no markup yet are escaped."""
    return Markup("".join(part if isinstance(part, Markup) else escape(part) for part in parts))


def tag(element: str, *content: str, **attributes: str | int | bool | None) -> Markup:
    """Return an element with its end tag: ``tag("b", name, class_="kind", data_key="1.2")``.

    Names of attributes lose a final underscore, and the others become hyphens. An attribute that is None or False is
    left out, one that is True stands without a value.
    """
    return Markup(f"{start(element, **attributes)}{join(*content)}</{element}>")


def start(element: str, **attributes: str | int | bool | None) -> Markup:
    """Return only the start tag: all there is of ``input`` and ``meta``."""
    written = (
        f" {name.rstrip('_').replace('_', '-')}" + ("" if value is True else f'="{escape(str(value))}"')
        for name, value in attributes.items()
        if value is not None and value is not False
    )
    return Markup(f"<{element}{''.join(written)}>")
