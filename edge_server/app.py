"""Application factory: joins configuration, database, services and routes."""

import secrets
import time
from collections.abc import Callable
from functools import cache
from typing import Any, Final

from flask import Flask
from flask.json.provider import DefaultJSONProvider

from edge_server.api import bodies, errors, headers, request_log, urls
from edge_server.api.access import audit_trail, auth, signatures
from edge_server.api.access.limits import Limits
from edge_server.api.routes import console, documentation, health, metrics
from edge_server.api.routes.administration import audit, backups, keys, session, storage, users
from edge_server.api.routes.fleet import broker, events, live, vehicle_logs, vehicles, videos
from edge_server.api.routes.planning import fields, maps, plan_files, plans, surveys
from edge_server.api.routes.reports import (
    alarm_history,
    bulk,
    dead_letters,
    flight_logs,
    flight_maps,
    flights,
    telemetry,
)
from edge_server.config import Config
from edge_server.live.changes import Changes
from edge_server.live.farm import Farm
from edge_server.live.reading import reader
from edge_server.live.video import Cameras
from edge_server.live.watcher import Watcher
from edge_server.metrics import Metrics
from edge_server.services.context import Context
from edge_server.store.connection.database import Database
from edge_server.store.connection.engines import open_engine


class _Json(DefaultJSONProvider):
    """JSON without NaN; members stay in the order of the code."""

    sort_keys = False
    compact = True

    def dumps(self, obj: Any, **options: Any) -> str:
        return super().dumps(obj, allow_nan=False, **options)


_MODULES = (
    plans,
    plan_files,
    events,
    fields,
    surveys,
    telemetry,
    bulk,
    dead_letters,
    vehicles,
    vehicle_logs,
    flights,
    flight_logs,
    flight_maps,
    maps,
    alarm_history,
    broker,
    live,
    videos,
    keys,
    session,
    users,
    audit,
    health,
    metrics,
    storage,
    backups,
    documentation,
    console,
)
"""Modules with a blueprint."""
_TABLES: Final = ("blueprints", "error_handler_spec", "url_map", "view_functions")
"""Attributes of an app that its routes and error handlers are in."""


def create_app(
    config: Config,
    *,
    clock: Callable[[], float] = time.time,
    monotonic: Callable[[], float] = time.monotonic,
) -> Flask:
    """Build the WSGI application; the database must have been prepared."""
    app = Flask("edge_server", static_folder=None)
    app.json = _Json(app)
    app.config.update(
        MAX_CONTENT_LENGTH=bodies.MAXIMUM_IMAGE_BODY_BYTES,
        PROPAGATE_EXCEPTIONS=False,
    )
    for name in _TABLES:
        setattr(app, name, getattr(_routes(), name))
    database = Database(open_engine(config.database))
    context = Context(config, database, clock, monotonic)
    app.extensions["edge_context"] = context
    figures = Metrics(config, database, context.archive, clock)
    context.space.count = figures.dropped
    app.extensions[metrics.EXTENSION] = figures
    request_log.install(app, figures)
    audit_trail.install(app, context)
    ring = auth.KeyRing(database, clock, monotonic)
    limits = Limits(config)
    app.extensions[auth.KEY_RING] = ring
    app.extensions[live.EXTENSION] = _live(context, ring)
    app.extensions[videos.EXTENSION] = Cameras(dict(config.video_streams))
    app.extensions[session.LIMITS] = limits
    app.before_request(console.lead_browser_to_console)
    app.before_request(documentation.link_browser_to_docs)
    app.before_request(lambda: auth.authorize(ring, limits, context))
    if config.cloud_jws_key_file is not None:
        from edge_server.api.access import jws  # noqa: PLC0415  # it costs memory

        app.extensions[signatures.EXTENSION] = jws.load(config.cloud_jws_key_file, config.edge_id)
    app.before_request(bodies.refuse_encoded)
    app.before_request(bodies.refuse_other_charset)
    app.before_request(bodies.refuse_repeated_parameters)
    app.before_request(signatures.check_request)
    headers.install(app, config)
    return app


@cache
def _routes() -> Flask:
    """Make the routes that every app of the process shares: to compile them takes 0.1 s."""
    app = Flask("edge_server", static_folder=None)
    urls.install(app)
    errors.install(app)
    for module in _MODULES:
        app.register_blueprint(module.blueprint())
    return app


def _live(context: Context, ring: auth.KeyRing) -> live.Live:
    """Make the live stream; while it is read, ended keys and sessions are noticed too."""
    read = reader(context)

    def read_all() -> Farm:
        ring.refresh()
        return read()

    changes = Changes(secrets.token_hex(4))
    return live.Live(changes, Watcher(read_all, changes))


def close(app: Flask) -> None:
    """Close the files and connections of an app that serves no more requests."""
    context_of(app).close()
    figures: Metrics = app.extensions[metrics.EXTENSION]
    figures.close()


def context_of(app: Flask) -> Context:
    """Give the context that the services of an app share."""
    found: Context = app.extensions["edge_context"]
    return found
