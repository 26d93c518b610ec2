"""Service without TLS, and invalid certificates and keys."""

import socket
import ssl
import subprocess
import threading
import time
from pathlib import Path

import pytest
import requests

from edge_server.config import Config, ConfigError, load
from edge_server.process import tls
from edge_server.process.exit_codes import OK, WRONG_SETUP
from mavlink_broker.edge.client import EdgeClient
from mavlink_broker.edge.outbox import Post, Urgency
from tests.support.polling import PATIENCE_S
from tests.unit.edge_server.program import Program, program_in


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """A certificate of this machine's loopback address, and its key."""
    folder = tmp_path_factory.mktemp("tls")
    certificate, key = folder / "certificate.pem", folder / "key.pem"
    curve = ["-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:prime256v1", "-nodes"]
    names = ["-subj", "/CN=127.0.0.1", "-addext", "subjectAltName=IP:127.0.0.1"]
    out = ["-keyout", str(key), "-out", str(certificate), "-days", "2"]
    command = ["openssl", "req", "-x509", *curve, *names, *out]
    subprocess.run(command, check=True, capture_output=True)
    return certificate, key


@pytest.mark.parametrize("host", ["127.0.0.1", "::1", "localhost", "127.1.2.3"])
def test_loopback_is_served_in_plain_text(host: str) -> None:
    tls.check_exposure(Config(host=host))


@pytest.mark.parametrize("host", ["0.0.0.0", "::", "", "192.0.2.7", "no.such.host.invalid"])
def test_other_addresses_are_not_served_in_plain_text(host: str) -> None:
    with pytest.raises(tls.ExposedError, match="EDGE_TLS_CERTIFICATE_FILE"):
        tls.check_exposure(Config(host=host))


def test_other_addresses_are_served_with_tls_or_with_permission() -> None:
    tls.check_exposure(Config(host="0.0.0.0", allow_plain_http=True))
    tls.check_exposure(Config(host="::", tls_certificate_file=Path("certificate.pem")))


def test_invalid_files_are_named(tmp_path: Path, files: tuple[Path, Path]) -> None:
    nonsense = tmp_path / "nonsense.pem"
    nonsense.write_text("nonsense", encoding="ascii")
    certificate, key = files
    for one, other in ((nonsense, key), (certificate, nonsense), (tmp_path / "none", key)):
        config = Config(tls_certificate_file=one, tls_key_file=other)
        with pytest.raises(tls.CertificateError, match="cannot be used"):
            tls.context_for(config)
    config = Config(tls_certificate_file=certificate, tls_key_file=key, tls_client_ca_file=nonsense)
    with pytest.raises(tls.CertificateError, match="nonsense"):
        tls.context_for(config)


@pytest.mark.parametrize("given", ["tls_certificate_file", "tls_key_file", "tls_client_ca_file"])
def test_certificate_and_key_are_set_together(given: str) -> None:
    with pytest.raises(ConfigError, match="EDGE_TLS"):
        load({given: "file.pem"}, {})


def connect(server: ssl.SSLContext, client: ssl.SSLContext) -> str | None:
    """Shake hands over a pair of sockets; returns the version of TLS."""
    ours, theirs = socket.socketpair()
    faults: list[Exception] = []

    def answer() -> None:
        try:
            with server.wrap_socket(ours, server_side=True) as wrapped:
                wrapped.recv(1)
        except (OSError, ssl.SSLError) as error:
            faults.append(error)
        finally:
            ours.close()

    thread = threading.Thread(target=answer)
    thread.start()
    try:
        with client.wrap_socket(theirs, server_hostname="127.0.0.1") as wrapped:
            wrapped.send(b"x")
            version = wrapped.version()
    finally:
        theirs.close()
        thread.join()
    if faults:
        raise faults[0]
    return version


def test_old_versions_are_refused(files: tuple[Path, Path]) -> None:
    certificate, key = files
    server = tls.context_for(Config(tls_certificate_file=certificate, tls_key_file=key))
    assert server is not None
    assert server.minimum_version is ssl.TLSVersion.TLSv1_2
    client = ssl.create_default_context(cafile=str(certificate))
    assert connect(server, client) == "TLSv1.3"


def test_with_an_authority_a_client_without_certificate_is_refused(
    files: tuple[Path, Path],
) -> None:
    certificate, key = files
    config = Config(
        tls_certificate_file=certificate, tls_key_file=key, tls_client_ca_file=certificate
    )
    server = tls.context_for(config)
    assert server is not None
    client = ssl.create_default_context(cafile=str(certificate))
    with pytest.raises((ssl.SSLError, OSError)):
        connect(server, client)
    client.load_cert_chain(certificate, key)
    assert connect(server, client) == "TLSv1.3"


def over_tls(program: Program, files: tuple[Path, Path]) -> None:
    """Configure a program for TLS."""
    certificate, key = files
    program.environment["EDGE_TLS_CERTIFICATE_FILE"] = str(certificate)
    program.environment["EDGE_TLS_KEY_FILE"] = str(key)


def wait_ready(program: Program, certificate: Path) -> requests.Response:
    deadline = time.monotonic() + PATIENCE_S
    while True:
        try:
            address = f"https://127.0.0.1:{program.port}/readyz"
            return requests.get(address, timeout=5, verify=str(certificate))
        except requests.RequestException:
            assert time.monotonic() < deadline, "it never became ready"
            time.sleep(0.05)


@pytest.mark.thorough
def test_the_program_and_the_brokers_client_use_tls(
    tmp_path: Path, files: tuple[Path, Path]
) -> None:
    certificate, _ = files
    with program_in(tmp_path / "state") as program:
        over_tls(program, files)
        program.begin("serve")
        answer = wait_ready(program, certificate)
        assert answer.headers["Strict-Transport-Security"]
        assert answer.headers["Server"] == "gunicorn"
        with pytest.raises(requests.RequestException):
            requests.get(f"http://127.0.0.1:{program.port}/readyz", timeout=5)
        key_file = tmp_path / "state" / "keys" / "broker.key"
        url = f"https://127.0.0.1:{program.port}"
        client = EdgeClient(url, key_file, lambda: None, ca_file=certificate)
        client.post(
            Post(
                method="PUT",
                path="/vehicles/7",
                body={"link_state": "connected"},
                vehicle_id=7,
                lane="vehicle",
                urgency=Urgency.REPORT,
                needs_registration=False,
            )
        )
        client.start()
        client.stop(PATIENCE_S)
        vehicle = requests.get(
            f"{url}/vehicles/7",
            headers={"X-API-Key": program.key("operator")},
            timeout=5,
            verify=str(certificate),
        )
        assert vehicle.json()["link_state"] == "connected"
        assert program.end()[0] == OK


@pytest.mark.thorough
def test_the_program_does_not_serve_others_in_plain_text(
    tmp_path: Path, files: tuple[Path, Path]
) -> None:
    with program_in(tmp_path / "state") as program:
        program.environment["EDGE_HOST"] = "0.0.0.0"
        process = program.spawn("serve")
        _, complaint = process.communicate(timeout=PATIENCE_S)
        assert process.returncode == WRONG_SETUP
        assert "EDGE_ALLOW_PLAIN_HTTP=true" in complaint
        over_tls(program, files)
        files[1].chmod(0o640)
        process = program.spawn("serve")
        _, complaint = process.communicate(timeout=PATIENCE_S)
        files[1].chmod(0o600)
        assert process.returncode == WRONG_SETUP
        assert "can be read by others" in complaint
