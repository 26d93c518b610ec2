"""`/metrics`: figures for those who watch over many machines (Prometheus' text format)."""

from apiflask import APIBlueprint
from flask import Response, current_app
from prometheus_client import CONTENT_TYPE_LATEST

from edge_server.api import urls
from edge_server.api.auth import PLANNERS, allow
from edge_server.api.contract import Contract, describe
from edge_server.observability.metrics import Metrics

EXTENSION = "edge_metrics"


def blueprint() -> APIBlueprint:
    """Make the route."""
    routes = APIBlueprint("metrics", __name__)
    urls.add(routes, ("metrics",), "metrics", show, "GET")
    return routes


@allow(PLANNERS)
@describe(Contract({200: None}))
def show() -> Response:
    """Give the figures as they are now."""
    metrics: Metrics = current_app.extensions[EXTENSION]
    return Response(metrics.page(), content_type=CONTENT_TYPE_LATEST)
