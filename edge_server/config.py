"""Settings of the edge server: read once, frozen, passed as arguments.

Each setting is a field of `Config` and a row of `SETTINGS`. A flag takes precedence over the
environment variable, that over the TOML file's table `[edge_server]`, that over the default.

ConfigError  a setting that cannot be used; the message names it and says what it must be
"""

import os
import re
import tomllib
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final, NamedTuple
from urllib.parse import unquote, urlsplit

_SCHEMES: Final = frozenset({"http", "https", "mqtt", "mqtts"})
_TOPIC_ROOT: Final = re.compile(r"/*+(?!\$)[^+#\x00-\x1f\x7f-\x9f]{0,200}")
_NAME: Final = re.compile(r"[A-Za-z0-9._-]{1,64}")


def _console_dir() -> Path:
    """Folder of the built console: in a wheel part of the package, in a checkout beside it."""
    package = Path(__file__).resolve().parent
    installed = package / "console_dist"
    return installed if installed.is_dir() else package.parent / "console" / "dist"


class ConfigError(Exception):
    """A setting that cannot be used."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Config:
    """All settings of the edge server and its relay."""

    state_dir: Path = Path("var")
    keys_folder: Path | None = None  # None: in the state folder
    console_dir: Path = field(default_factory=_console_dir)
    maps_folder: Path | None = None
    backups_folder: Path | None = None
    host: str = "127.0.0.1"
    port: int = 8000
    cloud_url: str = "http://127.0.0.1:8100"
    cloud_key_file: Path | None = None
    cloud_ca_file: Path | None = None  # No other authority is trusted
    cloud_fingerprint: str | None = None  # SHA-256 of its certificate, hex
    cloud_client_certificate_file: Path | None = None  # Certificate and key, PEM
    mqtt_confirm: str = "cloud"  # Whose acknowledgement deletes a record
    mqtt_client_id: str | None = None  # None: drawn once and kept
    mqtt_keep_alive_s: int = 30
    threads: int = 32
    connections: int = 2000
    connections_per_address: int = 256
    plan_lifetime_s: float = 12 * 3600.0
    held_plan_lifetime_s: float = 30 * 86_400.0
    queue_limit: int = 8  # Unfinished missions per vehicle
    farthest_m: float = 0.0  # These two as `VehicleLimits` has them
    longest_leg_m: float = 0.0
    backoff_base_s: float = 0.5
    backoff_cap_s: float = 10.0
    probe_interval_s: float = 15.0  # While the cloud refuses the key
    connect_timeout_s: float = 5.0
    read_timeout_s: float = 15.0
    relay_workers: int = 4
    data_budget_mib: int = 512
    picture_budget_mib: int = 1024
    dead_letter_budget_mib: int = 64
    log_level: str = "INFO"
    log_format: str = "auto"
    database_url: str | None = field(default=None, repr=False)  # It may hold a password
    requests_per_minute: int = 12_000  # Of one key of a person or the cloud
    broker_requests_per_minute: int = 600_000
    failures_per_minute: int = 600  # Unknown keys from one address
    sign_ins_per_minute: int = 10  # From one address
    session_hours: float = 12.0
    tls_certificate_file: Path | None = None
    tls_key_file: Path | None = None
    tls_client_ca_file: Path | None = None
    allow_plain_http: bool = False  # For other machines
    edge_id: str = "edge"
    cloud_jws_key_file: Path | None = None
    cloud_may_dispatch: bool = False
    retain_telemetry_days: float = 30.0
    retain_images_days: float = 30.0
    retain_plans_days: float = 365.0
    retain_audit_days: float = 365.0
    archive_days: float = 30.0
    archive_mib: int = 512  # 0: no archive
    video_streams: tuple[tuple[int, str], ...] = ()  # Vehicle, and its Motion JPEG
    edge_dir: Path = field(init=False)
    keys_dir: Path = field(init=False)
    maps_dir: Path = field(init=False)
    backups_dir: Path = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "edge_dir", self.state_dir / "edge")
        object.__setattr__(self, "keys_dir", self.keys_folder or self.state_dir / "keys")
        object.__setattr__(self, "maps_dir", self.maps_folder or self.state_dir / "maps")
        backups = self.backups_folder or self.state_dir / "backups"
        object.__setattr__(self, "backups_dir", backups)

    @property
    def database(self) -> str:
        """URL of the database: PostgreSQL's where it is set, else that of the SQLite file."""
        return self.database_url or f"sqlite:///{self.database_path}"

    @property
    def database_name(self) -> str:
        """Name of the database for messages; it holds no password."""
        if self.database_url is None:
            return str(self.database_path)
        parts = urlsplit(self.database_url)
        return f"the PostgreSQL database {parts.path[1:]} at {parts.hostname or 'this machine'}"

    @property
    def database_path(self) -> Path:
        """SQLite file; its -wal and -shm are in the same folder."""
        return self.edge_dir / "edge.sqlite3"

    @property
    def archive_path(self) -> Path:
        """SQLite file of the flight archive; a PostgreSQL database does not replace it."""
        return self.edge_dir / "archive.db"

    @property
    def server_tally_path(self) -> Path:
        """Counts of the server."""
        return self.edge_dir / "server.tally"

    @property
    def relay_tally_path(self) -> Path:
        """Counts of the relay."""
        return self.edge_dir / "relay.tally"

    @property
    def supervisor_tally_path(self) -> Path:
        """Counts of the supervisor of both."""
        return self.edge_dir / "supervisor.tally"

    @property
    def relay_lock_path(self) -> Path:
        """Lock that the relay of this state folder holds."""
        return self.edge_dir / "relay.lock"

    @property
    def ballast_path(self) -> Path:
        """File that reserves room for the relay on a full disk."""
        return self.edge_dir / "ballast"

    @property
    def start_reserve_path(self) -> Path:
        """File that reserves room to open the database on a full disk."""
        return self.edge_dir / "start-reserve"

    @property
    def wake_path(self) -> Path:
        """Pipe through which the server wakes the relay when a record is due."""
        return self.edge_dir / "relay.wake"


class Setting(NamedTuple):
    """One row: field of Config, environment variable, how to read it, what it means."""

    name: str
    variable: str
    read: Callable[[Any], Any]
    meaning: str


def _whole(low: int, high: int) -> Callable[[Any], int]:
    """Make the reader of a whole number; a file may write 8000.0."""
    refusal = f"must be a whole number from {low} to {high}"

    def read(value: Any) -> int:
        is_fraction = isinstance(value, float) and not value.is_integer()
        if isinstance(value, bool) or is_fraction:
            raise ValueError(refusal)
        try:
            number = int(value)
        except (TypeError, ValueError):
            raise ValueError(refusal) from None
        if not low <= number <= high:
            raise ValueError(refusal)
        return number

    return read


def _real(low: float, high: float, unit: str) -> Callable[[Any], float]:
    """Make the reader of a number with a unit."""
    refusal = f"must be {low:g} to {high:g} {unit}"

    def read(value: Any) -> float:
        try:
            number = float("nan") if isinstance(value, bool) else float(value)
        except (TypeError, ValueError):
            raise ValueError(refusal) from None
        if not low <= number <= high:
            raise ValueError(refusal)
        return number

    return read


def _seconds(low: float, high: float) -> Callable[[Any], float]:
    return _real(low, high, "seconds")


def _choice(*choices: str) -> Callable[[Any], str]:
    """Make the reader of one of several values, in any case."""

    def read(value: Any) -> str:
        for choice in choices:
            if str(value).lower() == choice.lower():
                return choice
        raise ValueError(f"must be {', '.join(choices[:-1])} or {choices[-1]}")

    return read


def _flag(value: Any) -> bool:
    found = {"true": True, "1": True, "false": False, "0": False}.get(str(value).lower())
    if found is None:
        raise ValueError("must be true or false")
    return found


def _url(value: Any) -> str:
    parts = urlsplit(str(value))
    if parts.scheme not in _SCHEMES or not parts.hostname or parts.query or parts.fragment:
        raise ValueError("must be an http, https, mqtt or mqtts address without a query")
    if parts.username is not None:
        raise ValueError("must not hold a user or a password")
    if parts.scheme.startswith("mqtt") and not _TOPIC_ROOT.fullmatch(unquote(parts.path)):
        raise ValueError("its path names MQTT topics: at most 200 characters, no +, # or leading $")
    if parts.port == 0:
        raise ValueError("must not name port 0")
    return str(value).rstrip("/")


def _database_url(value: Any) -> str:
    parts = urlsplit(str(value))
    known = parts.scheme in {"postgresql", "postgresql+psycopg"}
    if not known or len(parts.path) < 2 or parts.port == 0:  # Or a port that is no number
        raise ValueError("must be postgresql+psycopg://user@host/database")
    return f"postgresql+psycopg{str(value)[len(parts.scheme) :]}"


def _name(value: Any) -> str:
    if _NAME.fullmatch(name := str(value)) is None:
        raise ValueError("must be 1 to 64 letters, digits, dots, dashes or underscores")
    return name


def _fingerprint(value: Any) -> str:
    digits = str(value).replace(":", "").lower()
    if len(digits) != 64 or not set(digits) <= set("0123456789abcdef"):
        raise ValueError("must be a SHA-256, 64 hexadecimal digits")
    return digits


def _video_streams(value: Any) -> tuple[tuple[int, str], ...]:
    """Read `1=http://10.0.0.7:8080/stream,2=...`; a file may write a table of them."""
    table = value.items() if isinstance(value, Mapping) else value
    if isinstance(value, str):
        parts = filter(None, (part.strip() for part in value.split(",")))
        table = [part.partition("=")[::2] for part in parts]
    found: dict[int, str] = {}
    for number, url in table:
        if not str(number).strip().isdecimal() or int(number) in found:
            raise ValueError("must be vehicle=address, ... with each vehicle once")
        found[int(number)] = _video_address(int(number), str(url).strip())
    return tuple(sorted(found.items()))


def _video_address(number: int, url: str) -> str:
    parts = urlsplit(url)
    if parts.scheme not in {"http", "https"} or not parts.hostname or parts.port == 0:
        raise ValueError(f"the address of vehicle {number} must be an http or https one")
    if parts.username is not None:
        raise ValueError(f"the address of vehicle {number} must not hold a user or a password")
    return url


_DAYS: Final = _real(0.001, 36_500, "days")
_SESSION_HOURS: Final = _real(0.1, 8760, "hours")
_METRES: Final = _real(0, 1e6, "metres")
_MIB: Final = _whole(1, 2**20)
_PER_MINUTE: Final = _whole(1, 10_000_000)


SETTINGS: Final = (
    Setting("state_dir", "STATE_DIR", Path, "folder of database, keys and pipe"),
    Setting("keys_folder", "KEYS_DIR", Path, "folder of key files; default: STATE_DIR/keys"),
    Setting("console_dir", "EDGE_CONSOLE_DIR", Path, "folder of the built console"),
    Setting("maps_folder", "EDGE_MAPS_DIR", Path, "folder of base maps; default: STATE_DIR/maps"),
    Setting(
        "backups_folder", "EDGE_BACKUP_DIR", Path, "folder of backups; default: STATE_DIR/backups"
    ),
    Setting(
        "database_url",
        "DATABASE_URL",
        _database_url,
        "PostgreSQL database in place of the SQLite file",
    ),
    Setting("host", "EDGE_HOST", str, "address to listen on"),
    Setting("port", "EDGE_PORT", _whole(1, 65535), "port to listen on"),
    Setting("cloud_url", "CLOUD_URL", _url, "address of the cloud: HTTP or MQTT"),
    Setting("cloud_key_file", "CLOUD_KEY_FILE", Path, "file with the key that the cloud asks for"),
    Setting("cloud_ca_file", "CLOUD_CA_FILE", Path, "the only authority of the cloud, PEM"),
    Setting(
        "cloud_fingerprint",
        "CLOUD_FINGERPRINT",
        _fingerprint,
        "SHA-256 of the cloud's certificate, hex",
    ),
    Setting(
        "cloud_client_certificate_file",
        "CLOUD_CLIENT_CERTIFICATE_FILE",
        Path,
        "client certificate and key for the cloud, PEM",
    ),
    Setting(
        "mqtt_confirm", "MQTT_CONFIRM", _choice("cloud", "broker"), "cloud or broker: who confirms"
    ),
    Setting(
        "mqtt_client_id", "MQTT_CLIENT_ID", _name, "MQTT client id; default: drawn once and kept"
    ),
    Setting(
        "mqtt_keep_alive_s", "MQTT_KEEP_ALIVE_S", _whole(5, 3600), "MQTT keep-alive interval [s]"
    ),
    Setting("threads", "EDGE_THREADS", _whole(12, 256), "requests served at once"),
    Setting("connections", "EDGE_CONNECTIONS", _whole(16, 7000), "open connections"),
    Setting(
        "connections_per_address",
        "EDGE_CONNECTIONS_PER_ADDRESS",
        _whole(8, 7000),
        "open connections of one address",
    ),
    Setting(
        "plan_lifetime_s",
        "PLAN_LIFETIME_S",
        _seconds(1, 30 * 86400),
        "default lifetime of a plan",
    ),
    Setting(
        "held_plan_lifetime_s",
        "HELD_PLAN_LIFETIME_S",
        _seconds(1, 365 * 86400),
        "lifetime of a plan until its dispatch",
    ),
    Setting("queue_limit", "QUEUE_LIMIT", _whole(1, 1000), "unfinished missions per vehicle"),
    Setting("farthest_m", "FARTHEST_M", _METRES, "from the first position; 0: no limit"),
    Setting("longest_leg_m", "LONGEST_LEG_M", _METRES, "from position to position; 0: no limit"),
    Setting(
        "backoff_base_s",
        "RELAY_BACKOFF_BASE_S",
        _seconds(0.01, 60),
        "longest first retry delay",
    ),
    Setting("backoff_cap_s", "RELAY_BACKOFF_CAP_S", _seconds(0.01, 3600), "longest retry delay"),
    Setting(
        "probe_interval_s",
        "RELAY_PROBE_S",
        _seconds(0.05, 3600),
        "interval of probes of a refused uplink",
    ),
    Setting("connect_timeout_s", "RELAY_CONNECT_S", _seconds(0.1, 60), "timeout of a connection"),
    Setting("read_timeout_s", "RELAY_READ_S", _seconds(0.1, 600), "timeout of an answer"),
    Setting("relay_workers", "RELAY_WORKERS", _whole(2, 32), "requests to the cloud at once"),
    Setting("data_budget_mib", "DATA_BUDGET_MIB", _MIB, "MiB of records"),
    Setting("picture_budget_mib", "PICTURE_BUDGET_MIB", _MIB, "MiB of pictures"),
    Setting("dead_letter_budget_mib", "DEAD_LETTER_BUDGET_MIB", _MIB, "MiB of dead letters"),
    Setting(
        "log_level",
        "LOG_LEVEL",
        _choice("DEBUG", "INFO", "WARNING", "ERROR"),
        "DEBUG, INFO, WARNING or ERROR",
    ),
    Setting(
        "requests_per_minute",
        "EDGE_REQUESTS_PER_MINUTE",
        _PER_MINUTE,
        "requests per minute of a key",
    ),
    Setting(
        "broker_requests_per_minute",
        "EDGE_BROKER_REQUESTS_PER_MINUTE",
        _PER_MINUTE,
        "requests per minute of a broker's key",
    ),
    Setting(
        "failures_per_minute", "EDGE_FAILURES_PER_MINUTE", _PER_MINUTE, "unknown keys of an address"
    ),
    Setting(
        "sign_ins_per_minute", "EDGE_SIGN_INS_PER_MINUTE", _PER_MINUTE, "sign-ins from an address"
    ),
    Setting(
        "session_hours", "EDGE_SESSION_HOURS", _SESSION_HOURS, "hours until a person signs in again"
    ),
    Setting("tls_certificate_file", "EDGE_TLS_CERTIFICATE_FILE", Path, "certificate chain, PEM"),
    Setting("tls_key_file", "EDGE_TLS_KEY_FILE", Path, "private key, PEM, mode 0600"),
    Setting("tls_client_ca_file", "EDGE_TLS_CLIENT_CA_FILE", Path, "authority of clients, PEM"),
    Setting("allow_plain_http", "EDGE_ALLOW_PLAIN_HTTP", _flag, "serve other machines without TLS"),
    Setting("edge_id", "EDGE_ID", _name, "name of this server in signatures (aud)"),
    Setting("cloud_jws_key_file", "CLOUD_JWS_KEY_FILE", Path, "verifies the cloud's signatures"),
    Setting(
        "cloud_may_dispatch", "CLOUD_MAY_DISPATCH", _flag, "fly the cloud's plans undispatched"
    ),
    Setting(
        "retain_telemetry_days", "RETAIN_TELEMETRY_DAYS", _DAYS, "days to keep undelivered reports"
    ),
    Setting("retain_images_days", "RETAIN_IMAGES_DAYS", _DAYS, "days to keep undelivered pictures"),
    Setting("retain_plans_days", "RETAIN_PLANS_DAYS", _DAYS, "days to keep ended plans"),
    Setting("retain_audit_days", "RETAIN_AUDIT_DAYS", _DAYS, "days to keep the audit log"),
    Setting("archive_days", "EDGE_ARCHIVE_DAYS", _DAYS, "days to keep flights"),
    Setting(
        "archive_mib",
        "EDGE_ARCHIVE_MIB",
        _whole(0, 2**20),
        "MiB of the flight archive; 0 switches it off",
    ),
    Setting(
        "video_streams",
        "VIDEO_STREAMS",
        _video_streams,
        "live pictures: vehicle=address of Motion JPEG over HTTP, ...",
    ),
    Setting("log_format", "LOG_FORMAT", _choice("auto", "json", "text"), "auto, json or text"),
)


def load(
    flags: Mapping[str, Any], environment: Mapping[str, str], toml_path: Path | None = None
) -> Config:
    """Join flags (by field name), environment and TOML file; raises ConfigError."""
    table = _toml_table(toml_path) if toml_path else {}
    found: dict[str, Any] = {}
    cloud_port = environment.get("CLOUD_PORT")
    for setting in SETTINGS:
        if setting.name in table:
            found[setting.name] = _read(setting, table[setting.name], setting.name)
        if setting.name == "cloud_url" and cloud_port:
            found[setting.name] = _read(setting, f"http://127.0.0.1:{cloud_port}", "CLOUD_PORT")
        if raw := environment.get(setting.variable):
            found[setting.name] = _read(setting, raw, setting.variable)
        if (flag := flags.get(setting.name)) is not None:
            found[setting.name] = _read(setting, flag, "--" + setting.name.replace("_", "-"))
    _check_tls(found)
    found["state_dir"] = Path(os.path.abspath(found.get("state_dir", "var")))  # noqa: PTH100  # links stay as they are
    return Config(**found)


def _check_tls(found: Mapping[str, Any]) -> None:
    has_certificate, has_key = "tls_certificate_file" in found, "tls_key_file" in found
    if has_certificate != has_key:
        raise ConfigError("set EDGE_TLS_CERTIFICATE_FILE and EDGE_TLS_KEY_FILE both, or neither")
    if "tls_client_ca_file" in found and not has_key:
        raise ConfigError("EDGE_TLS_CLIENT_CA_FILE needs EDGE_TLS_CERTIFICATE_FILE as well")


def _read(setting: Setting, raw: Any, where: str) -> Any:
    try:
        return setting.read(raw)
    except (TypeError, ValueError) as error:
        raise ConfigError(f"{where}: {error}") from None


def _toml_table(path: Path) -> dict[str, Any]:
    try:
        table = tomllib.loads(path.read_text(encoding="utf-8")).get("edge_server", {})
    except OSError as error:
        raise ConfigError(f"{path}: {error.strerror}") from None
    except (UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
        raise ConfigError(f"{path}: {error}") from None
    if not isinstance(table, dict):
        raise ConfigError(f"{path}: edge_server must be a table")
    if unknown := table.keys() - {setting.name for setting in SETTINGS}:
        raise ConfigError(f"{path}: unknown setting {', '.join(sorted(unknown))}")
    return table


def make_state_folder(config: Config) -> None:
    """Create the folder of the state where it is missing.

    Raises:
        ConfigError: if this user cannot create it.
    """
    try:
        config.edge_dir.mkdir(parents=True, exist_ok=True, mode=0o700)
    except OSError as error:
        raise ConfigError(
            f"STATE_DIR: the folder {config.edge_dir} cannot be created ({error.strerror}); "
            "choose one in which this user may write"
        ) from None
