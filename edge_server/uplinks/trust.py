"""Whom we believe to be the cloud: a connection whose certificate may be pinned.

A fingerprint is the SHA-256 of the certificate itself: with it, no authority of the world can
speak for the cloud, nor the portal of a guest network.
"""

from typing import Any

from requests.adapters import HTTPAdapter

from edge_server.uplinks.bounded_http import POOLS


class PinnedAdapter(HTTPAdapter):
    """One kept-alive connection, never tried twice; its TLS checks the pin when there is one.

    An answer has the request's read timeout for the whole of it.
    """

    def __init__(self, fingerprint: str | None) -> None:
        self._pin = {"assert_fingerprint": fingerprint} if fingerprint else {}
        super().__init__(pool_maxsize=1, max_retries=0)

    def init_poolmanager(
        self,
        connections: int,
        maxsize: int,
        block: bool = False,  # noqa: FBT001, FBT002  # as requests calls it
        **options: Any,
    ) -> None:
        """Make direct connections."""
        super().init_poolmanager(connections, maxsize, block, **options, **self._pin)
        self.poolmanager.pool_classes_by_scheme = POOLS

    def proxy_manager_for(self, proxy: str, **options: Any) -> Any:
        """Make connections through a proxy."""
        manager = super().proxy_manager_for(proxy, **options, **self._pin)
        manager.pool_classes_by_scheme = POOLS
        return manager
