"""Who is believed to be the cloud, over real TLS."""

import ssl
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from edge_server.config import Config, ConfigError, load
from edge_server.outbox.answers import Answer, Reply, Unreachable
from edge_server.outbox.queue import OutboxRecord, Stream
from edge_server.uplinks.cloud_http import HttpUplink
from tests.support.certificates import Authority
from tests.support.mock_cloud import MockCloud, running_mock_cloud

RECORD = OutboxRecord(1, 1, "01K9Z4T1W8F6Q2M3N5P7R9S0VX", Stream(1, "pose"), '{"vehicle_id":1}', 0)
NOT_BELIEVED = "the cloud's certificate is not accepted"


class Tls:
    """A cloud with a certificate."""

    def __init__(self, folder: Path) -> None:
        self.authority = Authority(folder / "ours")
        self.stranger = Authority(folder / "stranger", "stranger")
        self.file, self.key, self.fingerprint = self.authority.certify("cloud")

    def context(self, *, asks_for_a_certificate: bool = False) -> ssl.SSLContext:
        context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
        context.load_cert_chain(self.file, self.key)
        if asks_for_a_certificate:
            context.verify_mode = ssl.CERT_REQUIRED
            context.load_verify_locations(self.authority.file)
        return context


@pytest.fixture
def tls(tmp_path: Path) -> Tls:
    """Certificates."""
    return Tls(tmp_path)


@pytest.fixture
def cloud(tls: Tls) -> Iterator[MockCloud]:
    """A cloud over TLS."""
    with running_mock_cloud(tls=tls.context()) as cloud:
        yield cloud


def send(cloud: MockCloud, **settings: Any) -> Reply:
    uplink = HttpUplink(Config(cloud_url=cloud.url, **settings))
    try:
        return uplink.send([RECORD])[0]
    finally:
        uplink.close()


def why_not_believed(cloud: MockCloud, **settings: Any) -> str:
    """What is wrong with the certificate of a cloud."""
    reply = send(cloud, **settings)
    assert isinstance(reply, Unreachable)
    said, _, why = reply.reason.partition(": ")
    assert said == NOT_BELIEVED
    return why


def test_the_named_authority_is_believed_and_no_other(tls: Tls, cloud: MockCloud) -> None:
    assert isinstance(send(cloud, cloud_ca_file=tls.authority.file), Answer)
    for settings in ({"cloud_ca_file": tls.stranger.file}, {}):
        assert "unable to get local issuer certificate" in why_not_believed(cloud, **settings)
    assert len(cloud.store.records()) == 1


def test_the_pinned_certificate_is_believed_and_no_other_of_its_authority(
    tls: Tls, cloud: MockCloud
) -> None:
    _, _, other = tls.authority.certify("other")
    ca_file = tls.authority.file
    good = send(cloud, cloud_ca_file=ca_file, cloud_fingerprint=tls.fingerprint)
    assert isinstance(good, Answer)
    assert send(cloud, cloud_ca_file=ca_file, cloud_fingerprint=other) == Unreachable(NOT_BELIEVED)


def test_the_certificate_of_another_host_is_not_believed(tls: Tls, cloud: MockCloud) -> None:
    elsewhere = cloud._replace(url=cloud.url.replace("127.0.0.1", "localhost"))
    assert "'localhost'" in why_not_believed(elsewhere, cloud_ca_file=tls.authority.file)


def test_a_certificate_that_has_expired_is_said_to_have(tls: Tls) -> None:
    tls.file, tls.key, _ = tls.authority.certify("old", ends_in_s=-60.0)
    with running_mock_cloud(tls=tls.context()) as cloud:
        why = why_not_believed(cloud, cloud_ca_file=tls.authority.file)
    assert why == "certificate has expired"


def test_a_cloud_without_tls_is_not_said_to_have_a_wrong_certificate(tls: Tls) -> None:
    with running_mock_cloud() as cloud:
        over_tls = cloud._replace(url=cloud.url.replace("http:", "https:"))
        reply = send(over_tls, cloud_ca_file=tls.authority.file)
    assert reply == Unreachable("no TLS connection to the cloud: wrong version number")


def test_our_certificate_is_shown_to_a_cloud_that_asks(tls: Tls) -> None:
    ours, _, _ = tls.authority.certify("edge")
    with running_mock_cloud(tls=tls.context(asks_for_a_certificate=True)) as cloud:
        ca_file = tls.authority.file
        answer = send(cloud, cloud_ca_file=ca_file, cloud_client_certificate_file=ours)
        assert isinstance(answer, Answer)
        assert isinstance(send(cloud, cloud_ca_file=ca_file), Unreachable)


@pytest.mark.parametrize("text", ["", "ab", "g" * 64, "a" * 63, "a" * 65])
def test_a_fingerprint_that_is_none_is_refused_at_the_start(text: str) -> None:
    with pytest.raises(ConfigError, match="fingerprint"):
        load({"cloud_fingerprint": text}, {})


def test_a_fingerprint_may_have_colons_and_capitals(tls: Tls) -> None:
    text = ":".join(
        tls.fingerprint[place : place + 2].upper() for place in range(0, len(tls.fingerprint), 2)
    )
    assert load({"cloud_fingerprint": text}, {}).cloud_fingerprint == tls.fingerprint
