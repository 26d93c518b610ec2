"""What must not be in a log is taken out of each finished line, however it came in.

Access keys keep their prefix, by which an operator finds them; credentials, signatures and the
queries of addresses go altogether. Pure.
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
    """Take secrets out of a line."""
    for pattern, put in _RULES:
        line = pattern.sub(put, line)
    return line
