"""What a real Mosquitto may do to an uplink: restart, refuse, limit, forget, be somebody else."""

import base64
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
import requests

from edge_server.process.preparation import prepare
from sim.cloud import mqtt_requests
from sim.cloud.mqtt import MqttReceiver
from sim.cloud.store import Store
from sim.launch.farm_client import rows
from tests.support import fake_cloud, pages
from tests.support.certificates import Authority
from tests.support.cloud_links import MqttLink, mqtt_link
from tests.support.fake_cloud import Handler, Received
from tests.support.mosquitto import Mosquitto, password_file, running_mosquitto
from tests.support.mqtt_cloud import running_mqtt_cloud
from tests.support.polling import PATIENCE_S, wait_until
from tests.support.station import Station, station_config
from tests.support.system import FarmSystem, wait_for
from tests.unit.edge_server import documents

POSES = range(12)


@contextmanager
def station_at(url: str, folder: Path, **settings: Any) -> Iterator[Station]:
    """A station that has not begun to relay."""
    config = station_config(folder / "state", url, **settings)
    prepare(config)
    station = Station(config)
    try:
        yield station
    finally:
        station.close()


@pytest.fixture
def link(tmp_path: Path) -> Iterator[MqttLink]:
    with mqtt_link(tmp_path / "broker") as opened:
        yield opened


def test_a_record_is_published_for_others_to_read_too(link: MqttLink, tmp_path: Path) -> None:
    with station_at(link.url, tmp_path) as station:
        station.ingest("battery", 3, vehicle_id=7)
        station.relay()
        station.wait_empty()
    (received,) = link.store.kept
    assert received.headers["Topic"] == "afarcloud/farm/battery/7"
    assert received.headers["Content-Type"] == "application/json"
    assert received.headers["Idempotency-Key"] == received.body["message_id"]


@pytest.mark.parametrize("keeps", [True, False], ids=["persistence", "forgets"])
@pytest.mark.parametrize("how", ["stop", "kill"])
def test_restarts_of_the_broker_under_way(tmp_path: Path, how: str, *, keeps: bool) -> None:
    lines = (f"persistence_location {tmp_path}/broker/", "persistence true") if keeps else ()
    with (
        mqtt_link(tmp_path / "broker", *lines) as link,
        station_at(link.url, tmp_path) as station,
    ):
        station.relay()
        for first in (0, 10):
            station.ingest("pose", *range(first, first + 10))
            link.store.wait_for(first + 1, PATIENCE_S)
            getattr(link.broker, how)()
            link.broker.start()
        station.wait_empty()
        assert link.store.stream(1, "pose") == list(range(20))


def test_a_broker_that_hangs_and_comes_back(link: MqttLink, tmp_path: Path) -> None:
    with station_at(link.url, tmp_path) as station:
        station.relay()
        station.ingest("pose", 0)
        station.wait_empty()
        link.broker.hang()
        station.ingest("pose", *range(1, 6))
        wait_until(lambda: station.rows("outbox", "attempts >= 2") > 0)
        link.broker.go_on()
        station.wait_empty()
        assert link.store.stream(1, "pose") == list(range(6))


def test_without_a_subscriber_nothing_is_confirmed(tmp_path: Path) -> None:
    with (
        running_mosquitto(tmp_path / "broker") as broker,
        station_at(broker.url, tmp_path) as station,
    ):
        station.ingest("pose", *POSES)
        station.relay()
        wait_until(lambda: station.rows("outbox", "attempts >= 3") > 0)
        assert station.rows("telemetry") == len(POSES)
        with running_mqtt_cloud(broker.port) as cloud:
            station.wait_empty()
            assert cloud.store.stream(1, "pose") == list(POSES)


def test_the_brokers_acknowledgement_confirms_only_if_configured(
    link: MqttLink, tmp_path: Path
) -> None:
    link.store.always = fake_cloud.lose_record  # Subscribed, acknowledged, never answered
    with station_at(link.url, tmp_path) as station:
        station.ingest("pose", 0)
        station.relay()
        wait_until(lambda: station.rows("outbox", "attempts >= 2") > 0)
        station.stop()
        assert station.rows("telemetry") == 1
    with station_at(link.url, tmp_path, mqtt_confirm="broker") as station:
        station.relay()
        station.wait_empty()


def test_the_broker_confirms_nothing_without_a_subscriber(tmp_path: Path) -> None:
    with (
        running_mosquitto(tmp_path / "broker") as broker,
        station_at(broker.url, tmp_path, mqtt_confirm="broker") as station,
    ):
        station.ingest("pose", *POSES)
        station.relay()
        wait_until(lambda: station.rows("outbox", "attempts >= 3") > 0)
        assert station.rows("telemetry") == len(POSES)
        with running_mqtt_cloud(broker.port) as cloud:
            station.wait_empty()
            cloud.store.wait_for(len(POSES), PATIENCE_S)  # The broker's word comes before the cloud
            assert cloud.store.stream(1, "pose") == list(POSES)


def login_file(folder: Path, text: str, mode: int = 0o600) -> Path:
    file = folder / "login"
    file.write_text(text, encoding="utf-8")
    file.chmod(mode)
    return file


def test_refused_credentials_pause_until_they_are_right(tmp_path: Path) -> None:
    folder = tmp_path / "broker"
    folder.mkdir()
    users = password_file(folder, farm="p:ä ss")
    lines = ("allow_anonymous false", f"password_file {users}")
    login = login_file(tmp_path, "farm:wrong\n")
    with (
        running_mosquitto(folder, *lines) as broker,
        running_mqtt_cloud(broker.port, user="farm", password="p:ä ss") as cloud,
        station_at(broker.url, tmp_path, cloud_key_file=login) as station,
    ):
        cloud.wait_until_it_listens()
        station.ingest("pose", *POSES)
        station.relay()
        wait_until(lambda: station.rows("outbox", "last_error LIKE '401%'") > 0)
        assert station.rows("outbox", "state = 'queued'") == len(POSES)
        login_file(tmp_path, "farm:p:ä ss\n", mode=0o644)
        station.ingest("alarm", 0)
        wait_until(lambda: station.rows("outbox", "kind = 'alarm' AND last_error LIKE '401%'") > 0)
        assert cloud.store.seen == []
        login.chmod(0o600)
        station.wait_empty()
        assert cloud.store.stream(1, "pose") == list(POSES)


def test_a_topic_that_is_forbidden_to_us_pauses(tmp_path: Path) -> None:
    rules = tmp_path / "rules"
    rules.write_text("topic read #\ntopic write afarcloud/farm/answers/#\n", encoding="utf-8")
    with (
        mqtt_link(tmp_path / "broker", "allow_anonymous true", f"acl_file {rules}") as link,
        station_at(link.url, tmp_path) as station,
    ):
        station.ingest("pose", *POSES)
        station.relay()
        wait_until(lambda: station.rows("outbox", "last_error LIKE '403%'") > 0)
        assert station.rows("outbox", "state = 'queued'") == len(POSES)
        assert link.store.seen == []
        link.broker.configure()
        link.broker.kill()
        link.broker.start()
        station.wait_empty()
        assert link.store.stream(1, "pose") == list(POSES)


def test_the_readmes_rules_let_only_the_cloud_confirm(tmp_path: Path) -> None:
    folder = tmp_path / "broker"
    folder.mkdir()
    rules = folder / "rules"
    rules.write_text(pages.text("reference/cloud-mqtt.md").split("```acl\n")[1].split("```")[0])
    users = password_file(folder, farm="one", cloud="two")
    lines = ("allow_anonymous false", f"password_file {users}", f"acl_file {rules}")
    login = login_file(tmp_path, "farm:one\n")
    with running_mosquitto(folder, *lines) as broker:
        settings: dict[str, Any] = {"cloud_key_file": login, "mqtt_client_id": "north"}
        with station_at(broker.url, tmp_path, **settings) as station:
            for kind in documents.TELEMETRY:
                station.ingest(kind, 0)
            station.relay()
            # Who logs in as a gateway hears no records, so it cannot even answer.
            with running_mqtt_cloud(broker.port, user="farm", password="one") as impostor:
                wait_until(lambda: station.rows("outbox", "attempts >= 2") > 0)
                assert impostor.store.seen == []
                assert station.rows("telemetry") == len(documents.TELEMETRY)
            with running_mqtt_cloud(broker.port, user="cloud", password="two") as cloud:
                station.wait_empty()
                wait_for(lambda: ("north", "online") in cloud.presence, "presence")
                assert len(cloud.store.kept) == len(documents.TELEMETRY)


@pytest.mark.parametrize("limit", ["max_packet_size 4000", "message_size_limit 4000"])
def test_a_record_too_large_for_the_broker_becomes_a_dead_letter(
    tmp_path: Path, limit: str
) -> None:
    with (
        mqtt_link(tmp_path / "broker", limit) as link,
        station_at(link.url, tmp_path) as station,
    ):
        frame = base64.b64encode(b"\xff\xd8\xff\xe0" + bytes(6000)).decode()
        large = station.ingest_document("image", 0, frame=frame, image_size=6004)
        station.ingest("image", 1, 2)
        station.ingest("pose", *POSES)
        station.relay()
        wait_until(lambda: station.rows("outbox", "state <> 'dead'") == 0)
        assert station.rows("outbox", f"record_id = {large} AND last_error LIKE '413%'") == 1
        assert link.store.stream(1, "image") == [1, 2]
        assert link.store.stream(1, "pose") == list(POSES)


def test_presence_is_published_and_a_killed_gateway_is_reported_by_its_will(
    link: MqttLink, tmp_path: Path
) -> None:
    with station_at(link.url, tmp_path, mqtt_client_id="north-gate") as station:
        station.relay()
        wait_for(lambda: ("north-gate", "online") in link.cloud.presence, "online")
        station.stop()
        wait_for(lambda: link.cloud.presence[-1:] == [("north-gate", "offline")], "offline")


def test_two_gateways_have_two_names_and_each_keeps_its_own(link: MqttLink, tmp_path: Path) -> None:
    for _ in range(2):
        for gateway in ("a", "b"):
            with station_at(link.url, tmp_path / gateway) as station:
                station.relay()
                station.ingest("pose", 0)
                station.wait_empty()
    wait_for(lambda: len(link.cloud.presence) == 8, "two times online and offline of each")
    assert len({name for name, _ in link.cloud.presence}) == 2


def test_hostile_answers_confirm_nothing(link: MqttLink, tmp_path: Path) -> None:
    hostile = [
        b"",
        b"\xff\xfe",
        b"[]",
        b"null",
        b'{"status": true}',
        b'{"status": "200"}',
        b'{"status": 200, "message_id": "01K9Z4T1W8F6Q2M3N5P7R9S0VX"}',
        b'{"status": 200' + b" " * 66_000 + b"}",
        b"[" * 50_000,
    ]

    def says(handler: Handler, _: Received) -> None:
        handler.answer(200, hostile[len(handler.store.seen) - 1])

    with station_at(link.url, tmp_path, read_timeout_s=20.0) as station:
        link.store.always = says
        station.ingest("pose", 0)
        station.relay()
        link.store.wait_until(lambda: len(link.store.seen) >= len(hostile), PATIENCE_S)
        assert station.rows("telemetry") == 1
        link.store.always = None
        station.wait_empty()


@pytest.fixture(scope="module")
def authority(tmp_path_factory: pytest.TempPathFactory) -> Authority:
    return Authority(tmp_path_factory.mktemp("authority"))


def tls_lines(authority: Authority) -> tuple[tuple[str, ...], str]:
    certificate, key, fingerprint = authority.certify("broker")
    files = (f"cafile {authority.file}", f"certfile {certificate}", f"keyfile {key}")
    return (*files, "require_certificate true", "use_identity_as_username true"), fingerprint


def tls_url(broker: Mosquitto) -> str:
    return broker.url.replace("mqtt://", "mqtts://")


def test_tls_with_our_own_certificate_and_a_pin(authority: Authority, tmp_path: Path) -> None:
    lines, fingerprint = tls_lines(authority)
    mine, _, _ = authority.certify("gateway")
    trust: dict[str, Any] = {
        "cloud_ca_file": authority.file,
        "cloud_client_certificate_file": mine,
        "mqtt_confirm": "broker",
        "cloud_fingerprint": fingerprint,
    }
    with running_mosquitto(tmp_path / "broker", *lines) as broker:
        with station_at(tls_url(broker), tmp_path, **trust) as station:
            station.ingest("pose", 0)
            station.relay()
            wait_until(
                lambda: station.rows("outbox", "last_error LIKE '%no subscriber%'") > 0
            )  # The broker spoke to us; it has no subscriber
        impostor: dict[str, Any] = {"cloud_fingerprint": "0" * 64}
        stranger: dict[str, Any] = {"cloud_ca_file": Authority(tmp_path / "other").file}
        nameless: dict[str, Any] = {"cloud_client_certificate_file": None}
        for change in (impostor, stranger, nameless):
            folder = tmp_path / next(iter(change))
            with station_at(tls_url(broker), folder, **trust | change) as station:
                station.ingest("pose", 0)
                station.relay()
                wait_until(lambda: station.rows("outbox", "attempts > 0") > 0)
                assert station.rows("outbox", "last_error LIKE '%no subscriber%'") == 0
                assert station.rows("telemetry") == 1
        url = tls_url(broker).replace("127.0.0.1", "localhost")  # Not what the certificate names
        trust["cloud_fingerprint"] = None
        with station_at(url, tmp_path / "misnamed", **trust) as station:
            station.ingest("pose", 0)
            station.relay()
            wait_until(lambda: station.rows("outbox", "attempts > 0") > 0)
            assert station.rows("outbox", "last_error LIKE '%certificate%'") == 1


def test_the_mock_cloud_takes_batches(tmp_path: Path) -> None:
    with running_mosquitto(tmp_path / "broker") as broker:
        store = Store(None)
        receiver = MqttReceiver(store, broker.url)
        receiver.open()
        try:
            with station_at(broker.url, tmp_path, read_timeout_s=20.0) as station:
                station.ingest("pose", *range(60))
                station.ingest("battery", *range(60))
                station.relay()
                station.wait_empty()
        finally:
            receiver.close()
    for kind in ("pose", "battery"):
        held = [record.body["sequence_number"] for record in store.records(kind)]
        assert held == list(range(60))


@pytest.mark.parametrize(
    "refusal", [{"status": 413}, {"status": 200}, {"status": 200, "results": [{"status": 200}]}]
)
def test_a_cloud_that_takes_back_its_batches_gets_single_records(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, refusal: dict[str, Any]
) -> None:
    batches = []

    def refuse_batches(store: Store, request: mqtt_requests.Request, now: float) -> dict[str, Any]:
        if request.topic != mqtt_requests.BATCH:
            return mqtt_requests.answer(store, request, now)
        batches.append(request)
        return refusal

    monkeypatch.setattr("sim.cloud.mqtt.answer", refuse_batches)
    with running_mosquitto(tmp_path / "broker") as broker:
        store = Store(None)
        receiver = MqttReceiver(store, broker.url)
        receiver.open()
        try:
            with station_at(broker.url, tmp_path, read_timeout_s=20.0) as station:
                station.relay()
                for first in (0, 20, 40):
                    station.ingest("pose", first)
                    station.wait_empty()  # By now we know that the cloud offers batches
                    broker.hang()
                    station.ingest("pose", *range(first + 1, first + 20))
                    broker.go_on()
                    station.wait_empty()
        finally:
            receiver.close()
    held = [record.body["sequence_number"] for record in store.records("pose")]
    assert held == list(range(60))
    assert len(batches) == 1


@pytest.mark.scenario
def test_the_launchers_programs_over_mqtt_survive_being_killed_one_by_one(tmp_path: Path) -> None:
    with FarmSystem(tmp_path, mqtt=True) as system:
        system.environment |= {"RELAY_BACKOFF_CAP_S": "0.2", "RELAY_READ_S": "2"}
        system.start("mosquitto", "cloud", "edge")
        system.wait_until_edge_answers()
        sent = 0
        for victim in ("mosquitto", "cloud", "edge"):
            sent = report_poses(system, sent, 5)
            system.kill(victim)
            if victim != "edge":
                sent = report_poses(system, sent, 5)
            system.start(victim)
            system.wait_until_edge_answers()
        wait_for(lambda: not rows(system.get("/pose/")), "delivery to the cloud")
        held = [record["body"]["sequence_number"] for record in system.cloud("/pose")]
        assert held == list(range(sent))


def report_poses(system: FarmSystem, first: int, count: int) -> int:
    """Post poses as the broker does; gives the next number."""
    url = f"{system.settings.edge_url}/pose/"
    for number in range(first, first + count):
        answer = requests.post(
            url,
            json=documents.telemetry("pose", number, 1),
            headers=system.headers("broker"),
            timeout=30,
        )
        assert answer.status_code == 201, answer.text
    return first + count
