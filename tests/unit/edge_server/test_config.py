"""Settings: sources, precedence, refusals."""

from pathlib import Path

import pytest

from edge_server.config import SETTINGS, Config, ConfigError, load


def test_defaults() -> None:
    config = load({}, {})
    assert (config.host, config.port) == ("127.0.0.1", 8000)
    assert config.cloud_url == "http://127.0.0.1:8100"
    assert config.state_dir.is_absolute()


def test_flags_beat_environment_beats_file_beats_default(tmp_path: Path) -> None:
    file = tmp_path / "edge.toml"
    file.write_text("[edge_server]\nport = 1001\nthreads = 20\nhost = '::1'\n", encoding="utf-8")
    environment = {"EDGE_PORT": "1002", "EDGE_THREADS": "21"}
    config = load({"port": "1003"}, environment, file)
    assert (config.port, config.threads, config.host) == (1003, 21, "::1")


def test_a_cloud_port_means_a_cloud_on_this_machine() -> None:
    assert load({}, {"CLOUD_PORT": "8200"}).cloud_url == "http://127.0.0.1:8200"
    both = {"CLOUD_PORT": "8200", "CLOUD_URL": "https://cloud.example/api/"}
    assert load({}, both).cloud_url == "https://cloud.example/api"


@pytest.mark.parametrize(
    ("variable", "value"),
    [
        ("EDGE_PORT", "0"),
        ("EDGE_PORT", "65536"),
        ("EDGE_PORT", "eighty"),
        ("CLOUD_URL", "ftp://cloud.example"),
        ("DATABASE_URL", "mysql://edge@db.example/edge"),
        ("DATABASE_URL", "postgresql+psycopg://edge@db.example"),
        ("DATABASE_URL", "postgresql+psycopg://edge@db.example:high/edge"),
        ("CLOUD_URL", "cloud.example"),
        ("CLOUD_URL", "http://user:password@cloud.example"),
        ("RELAY_BACKOFF_CAP_S", "nan"),
        ("RELAY_BACKOFF_CAP_S", "-1"),
        ("LOG_LEVEL", "LOUD"),
    ],
)
def test_a_bad_setting_is_refused_by_name(variable: str, value: str) -> None:
    with pytest.raises(ConfigError, match=variable):
        load({}, {variable: value})


@pytest.mark.parametrize("text", ["[edge_server]\nportt = 1", "not toml", "edge_server = 1"])
def test_a_bad_file_is_refused_by_name(tmp_path: Path, text: str) -> None:
    file = tmp_path / "edge.toml"
    file.write_text(text, encoding="utf-8")
    with pytest.raises(ConfigError, match=r"edge\.toml"):
        load({}, {}, file)
    with pytest.raises(ConfigError) as refusal:
        load({}, {}, tmp_path / "nowhere.toml")
    assert str(refusal.value) == f"{tmp_path / 'nowhere.toml'}: No such file or directory"


def test_every_setting_is_a_field_and_its_default_is_allowed() -> None:
    defaults = Config()
    for setting in SETTINGS:
        value = getattr(defaults, setting.name)
        assert value is None or setting.read(value) == value
    assert len({setting.variable for setting in SETTINGS}) == len(SETTINGS)


def test_key_files_are_in_the_state_folder_unless_set_otherwise(tmp_path: Path) -> None:
    assert load({"state_dir": str(tmp_path)}, {}).keys_dir == tmp_path / "keys"
    given = load({"state_dir": str(tmp_path)}, {"KEYS_DIR": str(tmp_path / "secrets")})
    assert given.keys_dir == tmp_path / "secrets"


def test_a_database_is_named_without_its_password() -> None:
    config = load({}, {"DATABASE_URL": "postgresql://edge:s3cret@db.example/farm"})
    assert config.database == "postgresql+psycopg://edge:s3cret@db.example/farm"
    assert "farm at db.example" in config.database_name
    assert "s3cret" not in repr(config) + config.database_name


def test_without_a_url_the_database_is_a_file_of_the_state_folder(tmp_path: Path) -> None:
    config = load({"state_dir": tmp_path}, {})
    assert config.database == f"sqlite:///{config.database_path}"
    assert config.database_name == str(config.database_path)


def test_a_cloud_port_of_the_environment_beats_the_file(tmp_path: Path) -> None:
    file = tmp_path / "edge.toml"
    file.write_text("[edge_server]\ncloud_url = 'https://cloud.example'\n", encoding="utf-8")
    assert load({}, {"CLOUD_PORT": "8200"}, file).cloud_url == "http://127.0.0.1:8200"
    assert load({}, {}, file).cloud_url == "https://cloud.example"


@pytest.mark.parametrize("value", ["8000.9", "inf", "nan", "true", "'8000.9'", "[1]"])
def test_a_number_of_the_file_that_is_not_whole_is_refused(tmp_path: Path, value: str) -> None:
    file = tmp_path / "edge.toml"
    file.write_text(f"[edge_server]\nport = {value}\n", encoding="utf-8")
    with pytest.raises(ConfigError, match="port"):
        load({}, {}, file)


def test_a_whole_number_may_be_written_with_a_point(tmp_path: Path) -> None:
    file = tmp_path / "edge.toml"
    file.write_text("[edge_server]\nport = 8000.0\n", encoding="utf-8")
    assert load({}, {}, file).port == 8000


@pytest.mark.parametrize(
    ("flags", "environment", "message"),
    [
        ({"port": "eighty"}, {}, "--port: must be a whole number from 1 to 65535"),
        ({}, {"RELAY_READ_S": "soon"}, "RELAY_READ_S: must be 0.1 to 600 seconds"),
        ({}, {"LOG_FORMAT": "xml"}, "LOG_FORMAT: must be auto, json or text"),
        (
            {},
            {"EDGE_TLS_KEY_FILE": "key.pem"},
            "set EDGE_TLS_CERTIFICATE_FILE and EDGE_TLS_KEY_FILE both, or neither",
        ),
    ],
)
def test_an_error_names_the_setting_and_what_it_must_be(
    flags: dict[str, str], environment: dict[str, str], message: str
) -> None:
    with pytest.raises(ConfigError) as refusal:
        load(flags, environment)
    assert str(refusal.value) == message
