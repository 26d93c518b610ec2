"""How a document is refused: one fault per faulty field, all of them at once.

AFarCloudError
  +- DocumentError          the document cannot be used; carries the faults
       +- SyntaxFaultError  it is not JSON at all
       +- InvalidError      it is JSON and breaks the model or a rule
"""

from typing import Final, NamedTuple

MOST_FAULTS: Final = 50
"""So many are reported; a document of a megabyte may have a hundred thousand."""


class Fault(NamedTuple):
    """One faulty field."""

    path: str  # Dotted, from the document's root: missions.0.command_array.2.parameters.altitude
    message: str
    code: int | None = None  # AFarCloud's validation code, where there is one
    name: str | None = None  # Its name: NO_COMMANDS and the like


class AFarCloudError(Exception):
    """Base of this package's exceptions."""


class DocumentError(AFarCloudError):
    """A document that cannot be used.

    It carries the first `MOST_FAULTS` faults and, if there are more, one that states how many;
    `uncounted` is how many there are that were not even made.
    """

    def __init__(self, faults: tuple[Fault, ...], uncounted: int = 0) -> None:
        shown = faults[:MOST_FAULTS]
        if (more := len(faults) - len(shown) + uncounted) > 0:
            shown = (*shown, Fault("", f"and {more} more faults"))
        super().__init__(
            "; ".join(f"{fault.path or 'document'}: {fault.message}" for fault in shown)
        )
        self.faults = shown


class SyntaxFaultError(DocumentError):
    """Bytes that are not JSON."""


class InvalidError(DocumentError):
    """JSON that breaks the model or a rule."""
