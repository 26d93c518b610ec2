"""`/metrics`: metrics in Prometheus' text format."""

from flask import Blueprint, Response, current_app
from prometheus_client import CONTENT_TYPE_LATEST

from edge_server.api import urls
from edge_server.api.access.auth import PLANNERS, allow
from edge_server.api.contract import Contract, describe
from edge_server.metrics import Metrics

EXTENSION = "edge_metrics"


def blueprint() -> Blueprint:
    """Make the route."""
    routes = Blueprint("metrics", __name__)
    urls.add(routes, ("metrics",), "metrics", show, "GET")
    return routes


@allow(PLANNERS)
@describe(Contract({200: None}))
def show() -> Response:
    """Give the metrics."""
    metrics: Metrics = current_app.extensions[EXTENSION]
    return Response(metrics.page(), content_type=CONTENT_TYPE_LATEST)
