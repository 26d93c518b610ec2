"""Where configuration, store, services and routes meet."""

import time
from collections.abc import Callable
from typing import Any

from apiflask import APIFlask
from flask.json.provider import DefaultJSONProvider
from flask_sqlalchemy import SQLAlchemy

from edge_server.api import (
    audit,
    auth,
    bodies,
    broker,
    bulk,
    dead_letters,
    documentation,
    errors,
    events,
    fields,
    headers,
    health,
    keys,
    metrics,
    plan_files,
    plans,
    request_log,
    signatures,
    surveys,
    telemetry,
    trails,
    urls,
    vehicles,
)
from edge_server.api.limits import Limits
from edge_server.config import Config
from edge_server.observability.metrics import Metrics
from edge_server.services.context import Context
from edge_server.store.database import Database
from edge_server.store.engines import engine_options, prepare_engine
from edge_server.store.tables import METADATA


class _Json(DefaultJSONProvider):
    """Answers without NaN, in the order in which we write them."""

    sort_keys = False
    compact = True

    def dumps(self, obj: Any, **options: Any) -> str:
        return super().dumps(obj, allow_nan=False, **options)


_PARTS = (
    plans,
    plan_files,
    events,
    fields,
    surveys,
    telemetry,
    bulk,
    dead_letters,
    vehicles,
    broker,
    keys,
    audit,
    health,
    metrics,
    documentation,
)
"""Whoever makes routes."""


def create_app(config: Config, *, clock: Callable[[], float] = time.time) -> APIFlask:
    """Build the WSGI application; the database must have been prepared."""
    app = APIFlask(
        "edge_server",
        enable_openapi=False,
        static_folder=None,  # type: ignore[arg-type]  # Flask takes it; the type says otherwise
    )
    app.json = _Json(app)
    app.config.update(
        SQLALCHEMY_DATABASE_URI=config.database,
        SQLALCHEMY_ENGINE_OPTIONS=engine_options(config.database),
        MAX_CONTENT_LENGTH=bodies.MAXIMUM_IMAGE_BODY_BYTES,
        PROPAGATE_EXCEPTIONS=False,
    )
    urls.install(app)
    errors.install(app)
    store = SQLAlchemy(metadata=METADATA)
    store.init_app(app)
    with app.app_context():
        database = Database(prepare_engine(store.engine))
    context = Context(config, database, clock)
    app.extensions["edge_context"] = context
    figures = Metrics(config, database, clock)
    context.space.count = figures.dropped
    app.extensions[metrics.EXTENSION] = figures
    request_log.install(app, figures)
    trails.install(app, context)
    ring = auth.KeyRing(database, clock)
    limits = Limits(config)
    app.extensions[keys.KEY_RING] = ring
    app.before_request(lambda: auth.check_caller(ring, limits, context))
    if config.cloud_jws_key_file is not None:
        from edge_server.api import jws  # noqa: PLC0415  # it costs memory

        app.extensions[signatures.EXTENSION] = jws.load(config.cloud_jws_key_file, config.edge_id)
    app.before_request(bodies.refuse_encoded)
    app.before_request(signatures.check_request)
    headers.install(app, config)
    for part in _PARTS:
        app.register_blueprint(part.blueprint())
    return app


def context_of(app: APIFlask) -> Context:
    """Give what the services of an app share."""
    found: Context = app.extensions["edge_context"]
    return found
