"""Redacts secrets in finished log lines. Pure.

Access keys keep their prefix, by which an operator finds them; credentials, signatures and query
strings are removed.
"""

import re
from typing import Final

_QUOTE: Final = r"(?:\\?[\"'])?"
_RULES: Final = (
    # A header with its value, as in a request, a dict or JSON within JSON
    (
        re.compile(
            rf"((?:proxy-)?authorization|x-api-key|x-jws-signature|cookie)({_QUOTE}\s*[:=,]\s*"
            rf"(?:b(?=[\"']))?{_QUOTE})(?:(?:bearer|basic|digest|token)\s+)?[^\s\"'\\,;)\]}}]+",
            re.IGNORECASE,
        ),
        r"\1\2***",
    ),
    (re.compile(r"\b(bearer|basic)\s+[\w.~+/=-]{8,}", re.IGNORECASE), r"\1 ***"),
    (re.compile(r"\b(fm_[0-9a-f]{1,8}_)[0-9A-Za-z]+"), r"\1***"),
    (re.compile(r"\bey[\w-]+\.[\w-]*\.[\w-]+"), "***"),  # A JWS; its header is JSON: {" is eyJ
    (re.compile(r"(://[^\s/:@\"']*):[^\s/@\"']+@"), r"\1:***@"),
    (re.compile(r"((?:\b\w+://|/)[^\s?\"'\\]*)\?[^\s\"'\\]+"), r"\1?***"),
)


def redact(line: str) -> str:
    """Remove secrets from a line."""
    for pattern, replacement in _RULES:
        line = pattern.sub(replacement, line)
    return line
