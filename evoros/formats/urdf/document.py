"""A robot's description as text and as elements."""

from copy import deepcopy

from lxml import etree
from lxml.etree import _Element as Element


class UrdfDocument:
    """The text of a ``<robot>`` and its elements, which stay as they are.

    It pickles as its text, because elements do not pickle. A copy that was pickled reads the text
    when the elements are first needed.
    """

    def __init__(self, text: str, root: Element | None = None) -> None:
        self.text = text
        self._root = root

    @classmethod
    def from_elements(cls, root: Element) -> "UrdfDocument":
        """Create the document of a ``<robot>``, which nobody may change afterwards."""
        return cls(etree.tostring(root, encoding="unicode", pretty_print=True), root)

    def __reduce__(self) -> tuple[type["UrdfDocument"], tuple[str]]:
        return type(self), (self.text,)

    def copy_elements(self) -> Element:
        """Return a copy of the elements, which the caller may change."""
        if self._root is None:
            self._root = etree.fromstring(self.text.encode())
        return deepcopy(self._root)
