"""What an operator may set: read once, frozen, passed to whoever needs it.

Each setting is one row of `SETTINGS`; flags beat environment variables, these beat the TOML
file's table `[edge_server]`, and that beats the default.

ConfigError  a setting that cannot be used; the message names it and says why
"""

import os
import tomllib
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final, NamedTuple
from urllib.parse import urlsplit


class ConfigError(Exception):
    """A setting that cannot be used."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Config:
    """All settings of the edge server and its relay."""

    state_dir: Path = Path("var")
    host: str = "127.0.0.1"
    port: int = 8000
    cloud_url: str = "http://127.0.0.1:8100"
    cloud_key_file: Path | None = None
    threads: int = 32
    plan_lifetime_s: float = 12 * 3600.0
    queue_limit: int = 8  # Unfinished missions per vehicle
    backoff_base_s: float = 0.5
    backoff_cap_s: float = 10.0
    probe_interval_s: float = 15.0  # While the cloud refuses our key
    connect_timeout_s: float = 5.0
    read_timeout_s: float = 15.0
    relay_workers: int = 4
    log_level: str = "INFO"
    edge_dir: Path = field(init=False)
    keys_dir: Path = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "edge_dir", self.state_dir / "edge")
        object.__setattr__(self, "keys_dir", self.state_dir / "keys")

    @property
    def database_path(self) -> Path:
        """The SQLite file; its -wal and -shm lie beside it."""
        return self.edge_dir / "edge.sqlite3"

    @property
    def wake_path(self) -> Path:
        """The pipe by which the server tells the relay that a record is due."""
        return self.edge_dir / "relay.wake"


class Setting(NamedTuple):
    """One row: field of Config, environment variable, how to read it, what it means."""

    name: str
    variable: str
    read: Callable[[Any], Any]
    meaning: str


def _whole(low: int, high: int) -> Callable[[Any], int]:
    def read(value: Any) -> int:
        if isinstance(value, bool) or not low <= (number := int(value)) <= high:
            raise ValueError(f"must be a whole number from {low} to {high}")
        return number

    return read


def _seconds(low: float, high: float) -> Callable[[Any], float]:
    def read(value: Any) -> float:
        if isinstance(value, bool) or not low <= (number := float(value)) <= high:
            raise ValueError(f"must be {low:g} to {high:g} seconds")
        return number

    return read


def _url(value: Any) -> str:
    parts = urlsplit(str(value))
    if parts.scheme not in {"http", "https"} or not parts.hostname or parts.query:
        raise ValueError("must be an http or https address without a query")
    if parts.username is not None:
        raise ValueError("must not hold a user or a password")
    return str(value).rstrip("/")


def _level(value: Any) -> str:
    if (name := str(value).upper()) not in {"DEBUG", "INFO", "WARNING", "ERROR"}:
        raise ValueError("must be DEBUG, INFO, WARNING or ERROR")
    return name


SETTINGS: Final = (
    Setting("state_dir", "STATE_DIR", Path, "folder of database, keys and pipe"),
    Setting("host", "EDGE_HOST", str, "address to listen on"),
    Setting("port", "EDGE_PORT", _whole(1, 65535), "port to listen on"),
    Setting("cloud_url", "CLOUD_URL", _url, "where records go"),
    Setting("cloud_key_file", "CLOUD_KEY_FILE", Path, "file with the key shown to the cloud"),
    Setting("threads", "EDGE_THREADS", _whole(12, 256), "requests served at once"),
    Setting("plan_lifetime_s", "PLAN_LIFETIME_S", _seconds(1, 30 * 86400), "default expires_at"),
    Setting("queue_limit", "QUEUE_LIMIT", _whole(1, 1000), "unfinished missions per vehicle"),
    Setting("backoff_base_s", "RELAY_BACKOFF_BASE_S", _seconds(0.01, 60), "first retry, at most"),
    Setting("backoff_cap_s", "RELAY_BACKOFF_CAP_S", _seconds(0.01, 3600), "any retry, at most"),
    Setting("probe_interval_s", "RELAY_PROBE_S", _seconds(0.05, 3600), "probe of a refused uplink"),
    Setting("connect_timeout_s", "RELAY_CONNECT_S", _seconds(0.1, 60), "reaching the cloud"),
    Setting("read_timeout_s", "RELAY_READ_S", _seconds(0.1, 600), "the cloud's answer"),
    Setting("relay_workers", "RELAY_WORKERS", _whole(2, 32), "requests to the cloud at once"),
    Setting("log_level", "LOG_LEVEL", _level, "DEBUG, INFO, WARNING or ERROR"),
)


def load(
    flags: Mapping[str, Any], environment: Mapping[str, str], toml_path: Path | None = None
) -> Config:
    """Join flags (by field name), environment and TOML file; raises ConfigError."""
    table = _toml_table(toml_path) if toml_path else {}
    found: dict[str, Any] = {}
    if port := environment.get("CLOUD_PORT"):
        found["cloud_url"] = _read(_SETTING["cloud_url"], f"http://127.0.0.1:{port}", "CLOUD_PORT")
    for setting in SETTINGS:
        if setting.name in table:
            found[setting.name] = _read(setting, table[setting.name], setting.name)
        if raw := environment.get(setting.variable):
            found[setting.name] = _read(setting, raw, setting.variable)
        if (flag := flags.get(setting.name)) is not None:
            found[setting.name] = _read(setting, flag, "--" + setting.name.replace("_", "-"))
    found["state_dir"] = Path(os.path.abspath(found.get("state_dir", "var")))  # noqa: PTH100  # links stay as they are
    return Config(**found)


_SETTING: Final = {setting.name: setting for setting in SETTINGS}


def _read(setting: Setting, raw: Any, where: str) -> Any:
    try:
        return setting.read(raw)
    except (TypeError, ValueError) as error:
        raise ConfigError(f"{where}: {error}") from None


def _toml_table(path: Path) -> dict[str, Any]:
    try:
        table = tomllib.loads(path.read_text(encoding="utf-8")).get("edge_server", {})
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
        raise ConfigError(f"{path}: {error}") from None
    if not isinstance(table, dict):
        raise ConfigError(f"{path}: edge_server must be a table")
    if unknown := table.keys() - _SETTING.keys():
        raise ConfigError(f"{path}: unknown setting {', '.join(sorted(unknown))}")
    return table
