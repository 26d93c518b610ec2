"""By what a sender is counted: its address, or its household's network when it is IPv6."""

import ipaddress
from typing import Final

_NETWORK_BITS: Final = 64
"""Of an IPv6 address: one household has all the others."""


def network_of(address: str | None) -> str:
    """Give by what an address is counted: itself, or its household when it is IPv6."""
    try:
        parsed = ipaddress.ip_address(address or "")
    except ValueError:
        return "unknown"
    if isinstance(parsed, ipaddress.IPv6Address):
        if parsed.ipv4_mapped is not None:
            return str(parsed.ipv4_mapped)
        return str(ipaddress.ip_network((parsed, _NETWORK_BITS), strict=False))
    return str(parsed)
