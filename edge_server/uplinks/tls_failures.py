"""Why there is no TLS connection, in the words of OpenSSL: an expired certificate, another host."""

import ssl


def describe(peer: str, error: ssl.SSLError) -> str:
    """Describe a failed handshake with a peer, such as "the cloud"."""
    if isinstance(error, ssl.SSLCertVerificationError):
        why = getattr(error, "verify_message", None) or error.args[-1]
        return f"{peer}'s certificate is not accepted: {str(why).rstrip('.')}"
    reason = getattr(error, "reason", None)
    why = str(error.args[-1]) if reason is None else reason.replace("_", " ").lower()
    return f"no TLS connection to {peer}: {why}"
