/** The map's sources and layers; colours come from the theme's custom properties. */

import type { LayerSpecification, StyleSpecification } from "maplibre-gl";

export const SOURCES = ["grid", "fields", "routes", "trails"] as const;
export type SourceName = (typeof SOURCES)[number];

/** Reads a colour of the present theme. */
function colour(name: string): string {
  return getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();
}

/** Makes the whole style; it is small enough to be set again when the theme changes. */
export function mapStyle(): StyleSpecification {
  const empty = { type: "FeatureCollection" as const, features: [] };
  return {
    version: 8,
    sources: Object.fromEntries(
      SOURCES.map((name) => [name, { type: "geojson" as const, data: empty }]),
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
  return [
    { id: "ground", type: "background", paint: { "background-color": colour("map-ground") } },
    {
      id: "field",
      type: "fill",
      source: "fields",
      filter: ["!=", ["get", "kind"], "exclusion"],
      paint: { "fill-color": colour("map-field"), "fill-opacity": 0.55 },
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
    route("present", { "line-color": colour("accent"), "line-width": 4, "line-dasharray": [2, 1] }),
  ];
}
