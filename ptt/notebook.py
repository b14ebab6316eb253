"""How a notebook shows what tells itself as text: letter for letter, in the columns that it is set in."""

import html


class InNotebook:
    """What a notebook shows as its text."""

    def _repr_html_(self) -> str:
        """The text, for a notebook."""
        return f"<pre>{html.escape(str(self))}</pre>"
