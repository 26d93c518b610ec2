"""The composition names what exists: targets, settings, secrets, volumes, networks, ports."""

import re
from pathlib import Path
from typing import Any

import pytest
import yaml  # type: ignore[import-untyped]  # it has no types

import edge_server.config
import mavlink_broker.config
import uav_firmware.config
from deploy import secret_files
from edge_server.process.server import GRACE_S
from edge_server.process.supervisor import STOP_WAIT_S
from edge_server.store.rows.keys import Role
from tests.unit.deploy.dockerfile import ROOT, TARGETS, stages
from tests.unit.deploy.settings import ANYWHERE, KNOWN

VARIABLE = re.compile(r"\$\{([A-Z_]+):-([^}]*)\}")
REQUIRED = re.compile(r"\$\{([A-Z_]+):\?[^}]*\}")
ENV_FILES = sorted((ROOT / "deploy").glob("*.env"))
STATE = "/var/lib/farm"
Service = dict[str, Any]


def read(name: str) -> dict[str, Any]:
    document: dict[str, Any] = yaml.safe_load((ROOT / "deploy" / name).read_text())
    return document


COMPOSE, TLS, SERIAL = read("compose.yaml"), read("tls.yaml"), read("serial.yaml")
VARIABLE_NAMES = REQUIRED.sub(
    r" \1 ", VARIABLE.sub(r" \1 ", (ROOT / "deploy/compose.yaml").read_text())
).split()
SERVICES: dict[str, Service] = COMPOSE["services"]
OURS = {name: service for name, service in SERVICES.items() if "build" in service}
every_service = pytest.mark.parametrize("name", SERVICES)
every_program = pytest.mark.parametrize("name", OURS)


def filled_in(text: str, **given: str) -> str:
    """What a value is with these variables, else with its defaults."""
    text = REQUIRED.sub(lambda found: given.get(found[1]) or EXAMPLE[found[1]], text)
    return VARIABLE.sub(lambda found: given.get(found[1]) or found[2], text)


def environment(name: str, *further: dict[str, Any], **given: str) -> dict[str, str]:
    """What a program finds: its image's variables, then the service's."""
    found: dict[str, str] = {}
    for source in (SERVICES[name], *(document["services"].get(name, {}) for document in further)):
        found |= source.get("environment", {})
    image = stages()[OURS[name]["build"]["target"]].environment
    return image | {key: filled_in(value, **given) for key, value in found.items()}


def settings_of(env_file: Path) -> dict[str, str]:
    lines = env_file.read_text().splitlines()
    return dict(line.split("=", 1) for line in lines if line and not line.startswith("#"))


EXAMPLE = settings_of(ROOT / "deploy/farm.env.example")


def test_the_example_gives_what_is_required_and_names_no_unknown_variable() -> None:
    files = ("compose.yaml", "tls.yaml", "serial.yaml")
    text = "".join((ROOT / "deploy" / name).read_text() for name in files)
    required = set(REQUIRED.findall((ROOT / "deploy/compose.yaml").read_text()))
    assert required == set(EXAMPLE) == {"CLOUD_URL"}
    shown = re.findall(
        r"^#?([A-Z_]+)=", (ROOT / "deploy/farm.env.example").read_text(), re.MULTILINE
    )
    settings = KNOWN["edge-server"] | KNOWN["broker"]
    assert set(shown) <= set(re.findall(r"\$\{([A-Z_]+):", text)) | settings


def test_a_radio_is_passed_through_to_the_broker_and_its_group_owns_it() -> None:
    assert set(SERIAL["services"]) == {"broker"}
    given = {"RADIO": "/dev/ttyUSB0", "RADIO_BAUD": "115200"}
    service = SERIAL["services"]["broker"]
    (device,) = (REQUIRED.sub(lambda found: given[found[1]], one) for one in service["devices"])
    inside = device.removeprefix("/dev/ttyUSB0:")
    config = mavlink_broker.config.load([], environment("broker", SERIAL, **given))
    assert [str(link) for link in config.vehicle_links] == [
        "udpin://0.0.0.0:14540",
        f"serial://{inside}:115200",
    ]
    assert service["group_add"] == ["${RADIO_GROUP:-20}"]


def test_every_program_has_its_service_from_its_own_target() -> None:
    assert {service["build"]["target"] for service in OURS.values()} == set(TARGETS)
    for service in OURS.values():
        build = service["build"]
        assert (ROOT / "deploy" / build["context"] / build["dockerfile"]).is_file()
        assert filled_in(service["image"]) == f"farm/{build['target']}:latest"


def test_the_profiles_are_those_that_are_promised() -> None:
    profiles = {name: tuple(s["profiles"]) for name, s in SERVICES.items() if "profiles" in s}
    assert set(SERVICES) - set(profiles) == {"edge-server", "relay", "broker"}
    assert {p for group in profiles.values() for p in group} == {
        "sim", "acceptance", "tester", "postgres", "mqtt", "setup",
    }  # fmt: skip


@every_program
def test_every_variable_is_a_setting_of_the_program(name: str) -> None:
    target = OURS[name]["build"]["target"]
    assert set(environment(name, TLS)) <= KNOWN[target] | ANYWHERE


@pytest.mark.parametrize("env_file", [None, *ENV_FILES], ids=lambda f: f.stem if f else "plain")
@pytest.mark.parametrize("name", ["edge-server", "relay"])
def test_the_edge_server_takes_its_settings(name: str, env_file: Path | None) -> None:
    given = settings_of(env_file) if env_file else {}
    config = edge_server.config.load({}, environment(name, TLS, **given))
    assert str(config.state_dir) == STATE
    assert config.cloud_url == given.get("CLOUD_URL", EXAMPLE["CLOUD_URL"])
    assert config.database_url == given.get("DATABASE_URL")


def test_the_broker_takes_its_settings() -> None:
    config = mavlink_broker.config.load([], environment("broker"))
    assert config.edge_url == "http://edge-server:8000"
    assert config.signing_keys == Path("/run/secrets")
    assert mavlink_broker.config.load([], environment("broker", TLS)).edge_ca_file is not None


@pytest.mark.parametrize("name", ["vehicle-1", "vehicle-2"])
def test_a_vehicle_takes_its_settings_and_calls_the_broker_by_name(name: str) -> None:
    config = uav_firmware.config.read_config([], environment(name))
    assert name == f"vehicle-{config.system_id}"
    assert (config.broker.host, config.bind) == ("broker", "0.0.0.0")
    port = stages()["broker"].environment["MAVLINK_PORT"]
    assert config.broker.port == int(port)


def test_edge_server_and_relay_see_the_same_database_and_cloud() -> None:
    shared = {"STATE_DIR", "DATABASE_URL", "CLOUD_URL", "CLOUD_KEY_FILE", "MQTT_CONFIRM"}
    server, relay = environment("edge-server"), environment("relay")
    assert {key: server[key] for key in shared} == {key: relay[key] for key in shared}
    assert SERVICES["edge-server"]["volumes"] == SERVICES["relay"]["volumes"]


@pytest.mark.parametrize("document", [COMPOSE, TLS], ids=["plain", "tls"])
def test_every_host_is_a_service_on_a_network_that_both_are_on(document: dict[str, Any]) -> None:
    for name, service in document["services"].items():
        for value in service.get("environment", {}).values():
            for host, port in re.findall(r"(?:https?://)?\b([a-z][a-z0-9-]+):(\d+)", value):
                target = SERVICES[host]["build"]["target"]
                assert stages()[target].last("EXPOSE").startswith(port)
                assert set(SERVICES[host]["networks"]) & set(SERVICES[name]["networks"])


def test_the_servers_of_the_env_files_are_services_of_their_profile() -> None:
    for file in ENV_FILES:
        values = settings_of(file)
        assert set(values) <= set(VARIABLE_NAMES)
        for host in re.findall(r"(?:://|@)(?:\w+@)?([a-z]+)[:/]", " ".join(values.values())):
            assert SERVICES[host]["profiles"] == [file.stem]


@every_program
def test_a_vehicle_and_the_cloud_are_apart(name: str) -> None:
    networks = set(SERVICES[name]["networks"])
    if name.startswith("vehicle"):
        assert networks == {"vehicles"}
    assert networks <= set(COMPOSE["networks"])
    meets_vehicles = name.startswith("vehicle") or name in {"broker", "tester"}
    assert ("vehicles" in networks) == meets_vehicles


def test_nothing_has_a_fixed_address() -> None:
    text = (ROOT / "deploy/compose.yaml").read_text()
    assert "ipv4_address" not in text
    assert "subnet" not in text
    assert set(re.findall(r"\b\d+\.\d+\.\d+\.\d+\b", text)) <= {"127.0.0.1"}


@every_program
def test_every_program_is_shut_in(name: str) -> None:
    service = OURS[name]
    assert service["read_only"] is True
    assert service["cap_drop"] == ["ALL"]
    assert "cap_add" not in service
    assert service["security_opt"] == ["no-new-privileges:true"]
    assert "user" not in service
    assert service["mem_limit"]
    assert service["pids_limit"]


@every_service
def test_every_server_comes_back_and_is_given_time_to_end(name: str) -> None:
    if name in {"tester", "acceptance", "setup"}:
        assert SERVICES[name].get("restart", "no") == "no"
        return
    assert SERVICES[name]["restart"] == "unless-stopped"
    assert int(SERVICES[name]["stop_grace_period"].removesuffix("s")) > max(GRACE_S, STOP_WAIT_S)


@every_service
def test_state_lies_in_volumes_that_exist_and_that_nobody_else_uses(name: str) -> None:
    volumes = [v for v in SERVICES[name].get("volumes", []) if not v.startswith((".", "$"))]
    assert {volume.split(":")[0] for volume in volumes} <= set(COMPOSE["volumes"])
    if name in OURS and name not in {"broker", "tester", "acceptance"}:
        assert [volume.split(":")[1] for volume in volumes] == [STATE]
    others = [v for n, s in SERVICES.items() if n != name for v in s.get("volumes", [])]
    assert not set(volumes) & set(others) or name in {"edge-server", "relay"}


def test_every_secret_is_made_and_used_and_every_other_file_exists(tmp_path: Path) -> None:
    made = set(secret_files.makers(tmp_path, vehicles=2))
    files = {name: Path(filled_in(s["file"])).name for name, s in COMPOSE["secrets"].items()}
    assert set(files.values()) <= made
    used = {s["source"] for service in SERVICES.values() for s in service.get("secrets", [])}
    assert used == set(COMPOSE["secrets"])
    for service in SERVICES.values():
        for volume in service.get("volumes", []):
            if volume.startswith("./"):
                assert (ROOT / "deploy" / volume.split(":")[0]).is_file()


@pytest.mark.parametrize("document", [COMPOSE, TLS], ids=["plain", "tls"])
def test_every_file_that_a_program_is_pointed_to_is_a_secret_of_its_service(
    document: dict[str, Any],
) -> None:
    for name, service in document["services"].items():
        secrets = SERVICES[name].get("secrets", []) + service.get("secrets", [])
        mounted = {f"/run/secrets/{secret['target']}" for secret in secrets}
        named = re.findall(r"/run/secrets/[\w.-]+", str(service.get("environment", {})))
        assert set(named) <= mounted
        sources = {**COMPOSE["secrets"], **document["secrets"]}
        assert {secret["source"] for secret in secrets} <= set(sources)


def test_the_edge_server_is_given_a_key_of_every_role_and_the_broker_only_its_own() -> None:
    given = {secret["target"] for secret in SERVICES["edge-server"]["secrets"]}
    assert {f"{role.value}.key" for role in Role} <= given
    seen = {secret["target"] for secret in SERVICES["broker"]["secrets"]}
    assert {name for name in seen if not name.startswith("signing-")} == {"broker.key"}


def test_a_vehicle_and_the_broker_sign_with_the_same_key() -> None:
    of_broker = {s["source"]: s["target"] for s in SERVICES["broker"]["secrets"]}
    for number in (1, 2):
        (secret,) = SERVICES[f"vehicle-{number}"]["secrets"]
        assert of_broker[secret["source"]] == f"signing-{number}.key"


def test_the_readme_tells_every_variable_and_none_that_does_not_exist() -> None:
    files = ("compose.yaml", "tls.yaml", "serial.yaml")
    text = "".join((ROOT / "deploy" / name).read_text() for name in files)
    defaults = dict(VARIABLE.findall(text)) | dict.fromkeys(REQUIRED.findall(text), "required")
    table = re.search(
        r"\| variable \|.*?\n\n", (ROOT / "docs/how-to/deploy-containers.md").read_text(), re.DOTALL
    )
    assert table is not None
    rows = re.findall(r"^\| (`[^|]+) \| ([^|]+) \|", table[0], re.MULTILINE)
    documented = [
        (re.findall(r"`([A-Z_]+)`", names), default.split(", ")) for names, default in rows
    ]
    assert {name for names, _ in documented for name in names} == set(defaults)
    for names, values in documented:
        for name, value in zip(names, values * len(names), strict=False):
            shown = {"none": "", "deploy/secrets": "./secrets"}.get(
                value.strip("`"), value.strip("`")
            )
            assert defaults[name] == shown


def test_the_readmes_own_file_names_settings_of_its_services() -> None:
    text = (ROOT / "docs/how-to/deploy-containers.md").read_text()
    (example,) = re.findall(r"^```yaml\n(.*?)^```$", text, re.MULTILINE | re.DOTALL)
    for name, service in yaml.safe_load(example)["services"].items():
        assert set(service["environment"]) <= KNOWN[OURS[name]["build"]["target"]]
        assert edge_server.config.load({}, service["environment"]).edge_id == "north-farm"


def test_every_file_that_the_readmes_commands_name_exists() -> None:
    text = (ROOT / "docs/how-to/deploy-containers.md").read_text()
    named = re.findall(r"(?:-f|--env-file) (\S+?)`?(?=\s)", text)
    assert named
    assert [name for name in named if not (ROOT / name).is_file()] == []
