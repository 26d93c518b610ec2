"""The report as one HTML page that needs nothing beside itself."""

import base64
from collections.abc import Iterable, Sequence
from html import escape
from typing import Final

from sim.mosaic.album import Album
from sim.report.figures import Flight
from sim.report.sheet import passage_mark, pictures
from sim.report.summary import summary

_STYLE: Final = """
body { font: 15px/1.45 system-ui, sans-serif; color: #1d252c; margin: 2em auto; max-width: 1240px;
       padding: 0 1em; }
h1 { margin: 0 0 .2em; } h2 { margin: 2em 0 .4em; border-bottom: 2px solid #1b4f8f; }
h3 { margin: 1.4em 0 .4em; } p.sub { color: #4a5560; margin: 0 0 1em; }
img { width: 100%; display: block; margin: .6em 0; }
table { border-collapse: collapse; } td, th { padding: .25em .8em; border-bottom: 1px solid #d8dde3;
       text-align: left; vertical-align: top; } th { background: #eef3fa; }
td.number { text-align: right; font-variant-numeric: tabular-nums; }
.columns { display: grid; gap: 0 2.5em;
       grid-template-columns: repeat(auto-fit, minmax(430px, 1fr)); }
.good { color: #256b33; font-weight: 600; } .bad { color: #c23b3b; font-weight: 600; }
"""
_NUMERIC: Final = frozenset("0123456789+-.")


def described(facts: Sequence[tuple[str, str]]) -> str:
    """Facts about a run as one line."""
    return "; ".join(f"{name} {value}" for name, value in facts)


def page(title: str, subtitle: str, flights: Sequence[Flight], albums: Sequence[Album] = ()) -> str:
    """Give the page: facts of the run, then a section per vehicle.

    Raises:
        OSError: if a sheet of an album cannot be read.
    """
    by_vehicle = {album.vehicle_id: album for album in albums}
    sections = "".join(_section(each, by_vehicle.get(each.vehicle_id)) for each in flights)
    return (
        '<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8">'
        f"<title>{escape(title)}</title><style>{_STYLE}</style></head><body>"
        f'<h1>{escape(title)}</h1><p class="sub">{escape(subtitle)}</p>{sections}'
        "</body></html>\n"
    )


def _section(flight: Flight, album: Album | None) -> str:
    images = "".join(
        f'<img alt="" src="data:image/png;base64,{base64.b64encode(picture).decode()}">'
        for picture in pictures(flight)
    )
    missions = ", ".join(flight.planned.statuses) or "no mission"
    return (
        f"<h2>Vehicle {flight.vehicle_id}: {escape(missions)}</h2>"
        f'<div class="columns"><div><h3>Summary</h3>{_table((), summary(flight))}</div>'
        f"<div><h3>Commands</h3>{_commands(flight)}"
        f"<h3>Points of the plan</h3>{_passages(flight)}</div></div>"
        f"{images}{_pictures(album)}<h3>Events</h3>{_events(flight)}"
    )


def _pictures(album: Album | None) -> str:
    """What the camera saw: the contact sheet, then the map."""
    if album is None:
        return ""
    sheets = [album.contact_sheet, *([] if album.mosaic is None else [album.mosaic.path])]
    images = "".join(
        f'<img alt="" src="data:image/jpeg;base64,{base64.b64encode(sheet.read_bytes()).decode()}">'
        for sheet in sheets
    )
    return f"<h3>Pictures</h3><p>{escape(album.sentence)}</p>{images}"


def _commands(flight: Flight) -> str:
    rows = [
        (str(command.command_id), command.name, command.summary, command.status)
        for command in flight.planned.commands
    ]
    return _table(("id", "command", "parameters", "status"), rows)


def _passages(flight: Flight) -> str:
    """Closest approach of the true track to each point."""
    rows = [
        (
            passage.point.label,
            f"{passage.time_s:.1f}",
            f"{passage.distance_m:.2f}",
            f"{passage.horizontal_m:.2f}",
            f"{passage.vertical_m:+.2f}",
            passage_mark(passage),
        )
        for passage in flight.passages
    ]
    head = ("point", "time [s]", "distance [m]", "level [m]", "height [m]", "inside")
    return _table(head, rows)


def _events(flight: Flight) -> str:
    rows = [(f"{event.time_s:.2f}", event.kind, event.text) for event in flight.events]
    return _table(("time [s]", "kind", "event"), rows)


def _table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    top = "".join(f"<th>{escape(cell)}</th>" for cell in head)
    body = "".join(f"<tr>{''.join(_cell(cell) for cell in row)}</tr>" for row in rows)
    return f"<table>{f'<tr>{top}</tr>' if head else ''}{body}</table>"


def _cell(text: str) -> str:
    if text and set(text) <= _NUMERIC:
        return f'<td class="number">{escape(text)}</td>'
    mark = {"FINISHED": "good", "yes": "good", "FAILED": "bad", "ABORTED": "bad", "NO": "bad"}
    return f'<td class="{mark.get(text, "")}">{escape(text)}</td>'
