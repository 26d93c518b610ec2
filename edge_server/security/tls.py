"""The door: who may reach it, and how what passes through it is kept from others.

ExposedError      other machines could reach us, and all on the way could read the keys
CertificateError  certificate, key or authority cannot be used
"""

import ipaddress
import socket
import ssl

from edge_server.config import Config


class ExposedError(Exception):
    """Other machines could reach us without TLS, and nobody has said that this is meant."""


class CertificateError(Exception):
    """Certificate, key or authority cannot be used."""


def check_exposure(config: Config) -> None:
    """Refuse to serve other machines in plain text; raises ExposedError."""
    if config.tls_certificate_file or config.allow_plain_http or is_this_machine(config.host):
        return
    raise ExposedError(
        f"other machines can reach {config.host or 'all addresses'}, and without TLS all on the "
        "way can read the keys: give EDGE_TLS_CERTIFICATE_FILE and EDGE_TLS_KEY_FILE, or say "
        "EDGE_ALLOW_PLAIN_HTTP=true where the network is guarded otherwise"
    )


def is_this_machine(host: str) -> bool:
    """Whether only programs of this machine reach an address."""
    try:
        found = socket.getaddrinfo(host, None) if host else []
    except (OSError, UnicodeError):
        return False
    addresses = [ipaddress.ip_address(str(entry[4][0]).partition("%")[0]) for entry in found]
    return bool(addresses) and all(address.is_loopback for address in addresses)


def context_for(config: Config) -> ssl.SSLContext | None:
    """Make what connections are wrapped in: TLS 1.2 or newer; None where we speak plain text.

    Raises:
        CertificateError: if a file cannot be used.
    """
    if config.tls_certificate_file is None:
        return None
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    context.minimum_version = ssl.TLSVersion.TLSv1_2
    try:
        # A key with a password would ask for it at a terminal that nobody watches
        context.load_cert_chain(config.tls_certificate_file, config.tls_key_file, password="")
    except (OSError, ssl.SSLError) as error:
        raise CertificateError(
            f"{config.tls_certificate_file} and {config.tls_key_file} cannot be used: {error}"
        ) from None
    if config.tls_client_ca_file is not None:
        _demand_certificates(context, config)
    return context


def _demand_certificates(context: ssl.SSLContext, config: Config) -> None:
    try:
        context.load_verify_locations(config.tls_client_ca_file)
    except (OSError, ssl.SSLError) as error:
        raise CertificateError(f"{config.tls_client_ca_file} cannot be used: {error}") from None
    context.verify_mode = ssl.CERT_REQUIRED
