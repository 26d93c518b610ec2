"""`/fields/`: boundaries of fields, as AFarCloud-like JSON, GeoJSON, KML, KMZ or Shapefile."""

import json
from typing import Any, Final

from flask import Blueprint, Response, make_response, request
from flask.typing import ResponseReturnValue

from afarcloud.faults import Fault, InvalidError
from afarcloud.wire import read_as
from edge_server.api import bodies, etags, planning_schemas, uploads, urls
from edge_server.api.access.auth import PLANNERS, READERS, allow, audit, caller
from edge_server.api.contract import Contract, describe
from edge_server.api.errors import RequestError
from edge_server.geodata import field, geojson, kml, shapefile, zipped
from edge_server.geodata.field import Field
from edge_server.geodata.rings import FieldFile
from edge_server.services.planning import fields
from edge_server.store.rows.keys import Role

NAMES: Final = ("fields", "field")
ITEM: Final = "int64:identifier"
WRITERS: Final = PLANNERS | {Role.FARMER}
FILES: Final = (
    geojson.MEDIA_TYPE,
    *sorted(kml.MEDIA_TYPES),
    kml.ZIPPED_MEDIA_TYPE,
    *sorted(shapefile.MEDIA_TYPES),
)
EXAMPLE: Final = {
    "name": "North field",
    "boundary": [
        [40.4430, -3.7392],
        [40.4440, -3.7392],
        [40.4440, -3.7380],
        [40.4430, -3.7380],
    ],
    "exclusions": [[[40.4434, -3.7387], [40.4436, -3.7387], [40.4436, -3.7385]]],
}
MOST_LEFT_OUT: Final = 50
_FORMATS: Final = ("json", "geojson")


def blueprint() -> Blueprint:
    """Make the routes."""
    routes = Blueprint("fields", __name__)
    urls.add(routes, NAMES, "create", create, "POST")
    urls.add(routes, NAMES, "page", page, "GET")
    urls.add(routes, NAMES, "get", get, "GET", item=ITEM)
    urls.add(routes, NAMES, "put", put, "PUT", item=ITEM)
    urls.add(routes, NAMES, "delete", delete, "DELETE", item=ITEM)
    return routes


@allow(WRITERS)
@describe(
    Contract(
        {201: planning_schemas.StoredFields},
        body=planning_schemas.FieldOrGeoJson,
        repeatable=True,
        files=FILES,
        example=EXAMPLE,
    )
)
def create() -> ResponseReturnValue:
    """Store the boundary of a field, or of every field of a file: all of them or none."""
    found, left_out = _fields()
    kept = fields.create_all(bodies.context(), found, caller())
    audit(f"posted fields {[one['id'] for one in kept]}")
    location = urls.path_of("fields.get", identifier=kept[0]["id"])
    shown: dict[str, Any] = kept[0] if len(kept) == 1 else {"fields": kept}
    if left_out:
        named = [{"path": one.path, "message": one.message} for one in left_out[:MOST_LEFT_OUT]]
        shown = {"fields": kept, "left_out": named}
    return shown, 201, {"Location": location}


@allow(READERS)
@describe(
    Contract(
        {200: planning_schemas.StoredField},
        is_list=True,
        query=("after", "limit", "since", "format:geojson"),
        other_answers=(geojson.MEDIA_TYPE,),
    )
)
def page() -> ResponseReturnValue:
    """List fields, as JSON or as one GeoJSON FeatureCollection."""
    found = fields.page(
        bodies.context(),
        after_id=bodies.query_after(),
        limit=bodies.query_limit(),
        since_s=bodies.query_time("since"),
    )
    if _wants_geojson():
        return _as_geojson(make_response({}), geojson.write(found))
    return make_response(found)


@allow(READERS)
@describe(
    Contract(
        {200: planning_schemas.StoredField},
        query=("format:geojson",),
        conditional=True,
        other_answers=(geojson.MEDIA_TYPE,),
    )
)
def get(identifier: int) -> ResponseReturnValue:
    """Give a field, as JSON or as a GeoJSON Feature."""
    found = fields.find(bodies.context(), identifier)
    wants_geojson = _wants_geojson()
    form = etags.FORMS[0] if wants_geojson else ""
    response = make_response(etags.tagged(found, form=form))
    if wants_geojson and response.status_code == 200:
        return _as_geojson(response, geojson.write_one(found))
    response.vary.add("Accept")
    return response


@allow(WRITERS)
@describe(
    Contract(
        {200: planning_schemas.StoredField},
        body=planning_schemas.FieldOrGeoJson,
        conditional=True,
        files=FILES,
        example=EXAMPLE,
    )
)
def put(identifier: int) -> ResponseReturnValue:
    """Replace a field."""
    found, _ = _fields()
    if len(found) != 1:
        raise InvalidError((Fault("", f"must be one field, not {len(found)}"),))
    stored = fields.replace(bodies.context(), identifier, found[0], etags.check_match)
    audit(f"replaced field {identifier}")
    return etags.tagged(stored)


@allow(PLANNERS)
@describe(Contract({204: None}, conditional=True))
def delete(identifier: int) -> ResponseReturnValue:
    """Delete a field."""
    fields.remove(bodies.context(), identifier, etags.check_match)
    audit(f"deleted field {identifier}")
    return "", 204


def _fields() -> tuple[list[Field], tuple[Fault, ...]]:
    """Read fields in any supported format, and what of it is no area.

    Raises DocumentError or RequestError.
    """
    upload = uploads.upload((uploads.JSON, *FILES))
    if _is_shapefile(upload):
        return _of_file(shapefile.read(upload.raw))
    if _is_kml(upload):
        return _of_file(kml.read(upload.raw))
    document = uploads.parsed(upload, "is not JSON, GeoJSON, KML, KMZ or a zipped Shapefile")
    if upload.media_type == geojson.MEDIA_TYPE or geojson.is_geojson(document):
        return _of_file(geojson.read(document))
    if isinstance(document, dict) and set(document) == {"field"}:
        document = document["field"]
    read = read_as(Field, document)
    field.check(read)
    return [read], ()


def _of_file(file: FieldFile) -> tuple[list[Field], tuple[Fault, ...]]:
    return [boundary.field for boundary in file.boundaries], file.left_out


def _is_shapefile(upload: uploads.Upload) -> bool:
    """Whether it is a Shapefile; a KMZ that is sent as a zip archive is none."""
    if upload.media_type not in shapefile.MEDIA_TYPES | {uploads.UNSPECIFIED}:
        return False
    if upload.media_type in shapefile.MEDIA_TYPES:
        _require_zip(upload)
    return shapefile.is_shapefile(upload.raw)


def _require_zip(upload: uploads.Upload) -> None:
    if not zipped.is_zip(upload.raw):
        raise InvalidError((Fault("", "is no zip archive"),))


def _is_kml(upload: uploads.Upload) -> bool:
    beginning = upload.raw.lstrip(b"\xef\xbb\xbf \t\r\n")[:2]
    if upload.media_type == uploads.UNSPECIFIED:
        return beginning in {b"<?", b"<k", b"<!", b"PK"}
    if upload.media_type == kml.ZIPPED_MEDIA_TYPE and not beginning.startswith(b"<"):
        _require_zip(upload)
    return upload.media_type in kml.MEDIA_TYPES | {kml.ZIPPED_MEDIA_TYPE} | shapefile.MEDIA_TYPES


def _wants_geojson() -> bool:
    """Whether `format` asks for GeoJSON, or `Accept` in a request without `format`."""
    form = request.args.get("format")
    if form is None:
        best = request.accept_mimetypes.best_match([uploads.JSON, geojson.MEDIA_TYPE])
        return best == geojson.MEDIA_TYPE
    if form not in _FORMATS:
        fault = Fault("format", "must be json or geojson")
        raise RequestError(422, "the query cannot be used", (fault,))
    return form == "geojson"


def _as_geojson(response: Response, document: dict[str, Any]) -> Response:
    """Replace the body of an answer by GeoJSON."""
    response.set_data(json.dumps(document, ensure_ascii=False, allow_nan=False))
    response.content_type = geojson.MEDIA_TYPE
    response.vary.add("Accept")
    return response
