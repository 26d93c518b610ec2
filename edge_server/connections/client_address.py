"""The network of a client, by which it is counted: its IPv4 address or its IPv6 /64."""

import ipaddress
from typing import Final

_NETWORK_BITS: Final = 64
"""Prefix length of an IPv6 network; one site usually has the whole of it."""


def network_of(address: str | None) -> str:
    """Give the network that an address counts for: itself, or its /64 if it is IPv6."""
    try:
        parsed = ipaddress.ip_address(address or "")
    except ValueError:
        return "unknown"
    if isinstance(parsed, ipaddress.IPv6Address):
        if parsed.ipv4_mapped is not None:
            return str(parsed.ipv4_mapped)
        return str(ipaddress.ip_network((parsed, _NETWORK_BITS), strict=False))
    return str(parsed)
