/** The map's sources and layers; colours come from the theme's custom properties. */

import type { ExpressionSpecification, LayerSpecification, StyleSpecification } from "maplibre-gl";

export const SOURCES = ["grid", "fields", "fences", "routes", "trails", "measurements"] as const;
export type SourceName = (typeof SOURCES)[number];

/** Of the fields' areas, where nothing lies below them. */
export const FIELD_OPACITY = 0.55;

/** Reads a colour of the present theme. */
function colour(name: string): string {
  return getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();
}

/** What is drawn, by the name of its source; nothing where one is missing. */
export type MapData = Partial<Record<SourceName, GeoJSON.FeatureCollection>>;

/** Makes the whole style; it is small enough to be set again when the theme changes. */
export function mapStyle(data: MapData): StyleSpecification {
  const empty = { type: "FeatureCollection" as const, features: [] };
  return {
    version: 8,
    sources: Object.fromEntries(
      SOURCES.map((name) => [name, { type: "geojson" as const, data: data[name] ?? empty }]),
    ),
    layers: layers(),
  };
}

function layers(): LayerSpecification[] {
  const route = (part: string, paint: object): LayerSpecification => ({
    id: `route-${part}`,
    type: "line",
    source: "routes",
    filter: ["==", ["get", "part"], part],
    layout: { "line-cap": "round", "line-join": "round" },
    paint,
  });
  const drone: ExpressionSpecification = [
    "match", ["get", "drone"],
    1, colour("drone-1"), 2, colour("drone-2"), 3, colour("drone-3"), 4, colour("drone-4"),
    5, colour("drone-5"), colour("drone-6"),
  ];
  return [
    { id: "ground", type: "background", paint: { "background-color": colour("map-ground") } },
    {
      id: "field",
      type: "fill",
      source: "fields",
      filter: ["!=", ["get", "kind"], "exclusion"],
      paint: { "fill-color": colour("map-field"), "fill-opacity": FIELD_OPACITY },
    },
    {
      id: "exclusion",
      type: "fill",
      source: "fields",
      filter: ["==", ["get", "kind"], "exclusion"],
      paint: { "fill-color": colour("bad"), "fill-opacity": 0.18 },
    },
    {
      id: "grid",
      type: "line",
      source: "grid",
      paint: {
        "line-color": colour("map-grid"),
        "line-width": ["case", ["get", "main"], 1.4, 0.7],
      },
    },
    {
      id: "field-edge",
      type: "line",
      source: "fields",
      paint: {
        "line-color": [
          "match", ["get", "kind"],
          "exclusion", colour("bad"), "drawn", colour("accent"), colour("map-edge"),
        ],
        "line-width": ["match", ["get", "kind"], "drawn", 3, 2],
      },
    },
    {
      id: "fence-exclusion",
      type: "fill",
      source: "fences",
      filter: ["==", ["get", "kind"], "exclusion"],
      paint: { "fill-color": colour("map-fence"), "fill-opacity": 0.18 },
    },
    {
      id: "fence",
      type: "line",
      source: "fences",
      layout: { "line-join": "round" },
      paint: { "line-color": colour("map-fence"), "line-width": 3, "line-dasharray": [4, 1.5, 1, 1.5] },
    },
    {
      id: "trail",
      type: "line",
      source: "trails",
      layout: { "line-cap": "round", "line-join": "round" },
      paint: { "line-color": colour("map-trail"), "line-width": 2, "line-opacity": 0.75 },
    },
    route("ahead", {
      "line-color": colour("map-route"),
      "line-width": 2.5,
      "line-dasharray": [1.5, 2],
    }),
    route("flown", { "line-color": colour("accent"), "line-width": 4 }),
    route("transit", { "line-color": drone, "line-width": 1.5, "line-dasharray": [1.5, 2] }),
    route("survey", { "line-color": drone, "line-width": 2.5 }),
    {
      id: "survey-footprint",
      type: "fill",
      source: "routes",
      filter: ["==", ["get", "part"], "footprint"],
      paint: { "fill-color": drone, "fill-opacity": 0.045, "fill-outline-color": drone },
    },
    {
      id: "survey-picture",
      type: "circle",
      source: "routes",
      filter: ["==", ["get", "part"], "picture"],
      paint: {
        "circle-radius": ["interpolate", ["linear"], ["zoom"], 15, 1, 19, 4],
        "circle-color": colour("surface"),
        "circle-stroke-color": drone,
        "circle-stroke-width": ["interpolate", ["linear"], ["zoom"], 15, 0.5, 19, 2],
      },
    },
    {
      id: "route-waypoint",
      type: "circle",
      source: "routes",
      filter: ["==", ["get", "kind"], "waypoint"],
      paint: {
        "circle-radius": 4,
        "circle-color": colour("surface"),
        "circle-stroke-color": [
          "match", ["get", "part"], "ahead", colour("map-route"), colour("accent"),
        ],
        "circle-stroke-width": 2,
      },
    },
    {
      id: "measurement",
      type: "circle",
      source: "measurements",
      paint: {
        "circle-color": ["get", "colour"],
        "circle-radius": ["case", ["get", "chosen"], 11, 7],
        "circle-stroke-color": ["case", ["get", "chosen"], colour("accent"), colour("ink")],
        "circle-stroke-width": ["case", ["get", "chosen"], 4, 1.5],
      },
    },
    route("present", { "line-color": colour("accent"), "line-width": 4, "line-dasharray": [2, 1] }),
  ];
}
