"""Security headers of every answer: what a browser may do with it, and that it is not cached.

The server's name is gunicorn's, without a version.
"""

from typing import Final

from flask import Flask, Response

from edge_server.config import Config

CONTENT_SECURITY_POLICY: Final = (
    "default-src 'self'; worker-src 'self'; object-src 'none'; base-uri 'none'; "
    "form-action 'self'; frame-ancestors 'none'"
)
HEADERS: Final = {
    "Content-Security-Policy": CONTENT_SECURITY_POLICY,
    "X-Content-Type-Options": "nosniff",
    "X-Frame-Options": "DENY",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Cache-Control": "no-store",
}
"""Defaults: a header that a view has set takes precedence."""
STRICT_TRANSPORT: Final = "max-age=31536000"


def install(app: Flask, config: Config) -> None:
    """Add the headers to every answer of an app."""
    headers = dict(HEADERS)
    if config.tls_certificate_file is not None:
        headers["Strict-Transport-Security"] = STRICT_TRANSPORT

    def harden(response: Response) -> Response:
        for name, value in headers.items():
            response.headers.setdefault(name, value)
        return response

    app.after_request(harden)
