"""The launcher's view of the running system, over the same HTTP as any other client."""

from datetime import datetime
from pathlib import Path
from typing import Any

import requests

from sim.launch.settings import Settings

TIMEOUT_S = 5.0
PERSON = "operator"
"""Account of the person who runs the system."""


class NotReadyError(Exception):
    """The other side cannot be asked yet."""


class RefusedError(Exception):
    """The edge server refused a request; the message is its answer."""


class FarmClient:
    """Asks the edge server as the operator, and the mock cloud."""

    def __init__(self, settings: Settings) -> None:
        self._settings = settings
        self._session = requests.Session()

    def edge(self, path: str) -> Any:
        """GET from the edge server; raises NotReadyError or RefusedError."""
        return self._request("GET", self._settings.edge_url + path, self._key())

    def cloud(self, path: str) -> Any:
        """GET from the mock cloud; raises NotReadyError or RefusedError."""
        return self._request("GET", self._settings.cloud_url + path, None)

    def post_plan(self, plan: dict[str, Any]) -> Any:
        """POST a plan as the operator; raises NotReadyError or RefusedError."""
        return self._request("POST", self._settings.edge_url + "/plans/", self._key(), plan)

    def console_address(self) -> str | None:
        """Give an address that signs the operator in at the console once; None if it is not built.

        Raises:
            NotReadyError: if the edge server cannot be asked.
            RefusedError: if it makes no such address.
        """
        edge_url, admin = self._settings.edge_url, self._key("admin")
        try:
            answer = self._session.get(f"{edge_url}/console/", timeout=TIMEOUT_S)
        except requests.RequestException as error:
            raise NotReadyError(f"{edge_url}: {type(error).__name__}") from None
        if not answer.ok:
            return None
        account = {"name": PERSON, "role": "operator"}
        if PERSON not in {one["name"] for one in self._request("GET", f"{edge_url}/users/", admin)}:
            self._request("POST", f"{edge_url}/users/", admin, account)
        link = self._request("POST", f"{edge_url}/users/{PERSON}/link", admin)
        return f"{edge_url}{link['path']}"

    def connected_vehicles(self, since: datetime | None = None) -> dict[int, dict[str, Any]]:
        """Give the vehicles that the broker is in touch with, by vehicle id.

        Args:
            since: leave out what was reported before, such as by the broker of a former run.
        """
        return {
            entry["vehicle_id"]: entry
            for entry in rows(self.edge("/vehicles/"))
            if entry.get("link_state") == "connected"
            and (since is None or datetime.fromisoformat(entry["updated_at"]) >= since)
        }

    def _key(self, role: str = "operator") -> str:
        path: Path = self._settings.key_path(role)
        try:
            return path.read_text(encoding="utf-8").strip()
        except OSError as error:
            raise NotReadyError(f"{path}: {error.strerror}") from None

    def _request(self, method: str, url: str, key: str | None, body: Any = None) -> Any:
        headers = {"Authorization": f"Bearer {key}"} if key else {}
        try:
            answer = self._session.request(
                method, url, json=body, headers=headers, timeout=TIMEOUT_S
            )
        except requests.RequestException as error:
            raise NotReadyError(f"{url}: {type(error).__name__}") from None
        if answer.status_code >= 500 or answer.status_code == 401:
            raise NotReadyError(f"{url}: {answer.status_code}")
        if not answer.ok:
            raise RefusedError(f"{answer.status_code}: {answer.text.strip()}")
        return answer.json()


def rows(answer: Any) -> list[dict[str, Any]]:
    """Give the list in a listing, whether it is bare or in an envelope."""
    if isinstance(answer, dict):
        return next((v for v in answer.values() if isinstance(v, list)), [])
    return list(answer)
