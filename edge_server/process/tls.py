"""TLS of the server, and the refusal to serve other machines without it.

ExposedError      other machines could connect without TLS
CertificateError  certificate, key or authority cannot be used
"""

import ipaddress
import socket
import ssl

from edge_server.config import Config


class ExposedError(Exception):
    """Other machines could connect without TLS, and EDGE_ALLOW_PLAIN_HTTP is not set."""


class CertificateError(Exception):
    """Certificate, key or authority cannot be used."""


def check_exposure(config: Config) -> None:
    """Refuse to serve other machines in plain text; raises ExposedError."""
    if config.tls_certificate_file or config.allow_plain_http or is_this_machine(config.host):
        return
    raise ExposedError(
        f"other machines can connect to {config.host or 'all addresses'} without TLS, so that the "
        "keys can be read on the network: set EDGE_TLS_CERTIFICATE_FILE and EDGE_TLS_KEY_FILE, or "
        "EDGE_ALLOW_PLAIN_HTTP=true where the network is protected otherwise"
    )


def is_this_machine(host: str) -> bool:
    """Whether an address is a loopback address."""
    try:
        found = socket.getaddrinfo(host, None) if host else []
    except (OSError, UnicodeError):
        return False
    addresses = [ipaddress.ip_address(str(entry[4][0]).partition("%")[0]) for entry in found]
    return bool(addresses) and all(address.is_loopback for address in addresses)


def context_for(config: Config) -> ssl.SSLContext | None:
    """Make the TLS context, TLS 1.2 or newer; None without a certificate.

    Raises:
        CertificateError: if a file cannot be used.
    """
    if config.tls_certificate_file is None:
        return None
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    context.minimum_version = ssl.TLSVersion.TLSv1_2
    try:
        # Without this a key with a passphrase would ask for it on the terminal
        context.load_cert_chain(config.tls_certificate_file, config.tls_key_file, password="")
    except (OSError, ssl.SSLError) as error:
        raise CertificateError(
            f"{config.tls_certificate_file} and {config.tls_key_file} cannot be used: {error}"
        ) from None
    if config.tls_client_ca_file is not None:
        _require_client_certificates(context, config)
    return context


def _require_client_certificates(context: ssl.SSLContext, config: Config) -> None:
    try:
        context.load_verify_locations(config.tls_client_ca_file)
    except (OSError, ssl.SSLError) as error:
        raise CertificateError(f"{config.tls_client_ca_file} cannot be used: {error}") from None
    context.verify_mode = ssl.CERT_REQUIRED
