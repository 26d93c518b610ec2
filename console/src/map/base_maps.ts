/** Base maps below everything else: PMTiles archives of the edge server, read a range at a time. */

import type { LayerSpecification, Map as MapLibreMap, StyleSpecification } from "maplibre-gl";
import { PMTiles, Protocol } from "pmtiles";
import type { BaseMap } from "../api/types";
import maplibregl from "./maplibre";

/** Opacity of the base maps that are shown, by name. */
export type ShownMaps = Record<string, number>;

const KEY = "farm-console-maps";
const PREFIX = "base:";
/** Base maps lie below this layer. */
const ABOVE = "field";
const protocol = new Protocol();
maplibregl.addProtocol("pmtiles", protocol.tile);

/** Reads which maps this browser shows; without a choice none. */
export function readShownMaps(): ShownMaps {
  try {
    return JSON.parse(localStorage.getItem(KEY) ?? "{}") as ShownMaps;
  } catch {
    return {}; // Storage is switched off, or holds something else
  }
}

export function storeShownMaps(shown: ShownMaps): void {
  try {
    localStorage.setItem(KEY, JSON.stringify(shown));
  } catch {
    // It holds until the page is closed
  }
}

/** Keeps the base maps of a style that is replaced by that of another theme. */
export function keepBaseMaps(previous: StyleSpecification | undefined, next: StyleSpecification): StyleSpecification {
  if (previous === undefined) return next;
  const sources = Object.entries(previous.sources).filter(([name]) => name.startsWith(PREFIX));
  const layers = previous.layers.filter(({ id }) => id.startsWith(PREFIX));
  const at = next.layers.findIndex(({ id }) => id === ABOVE);
  return {
    ...next,
    sources: { ...next.sources, ...Object.fromEntries(sources) },
    layers: [...next.layers.slice(0, at), ...layers, ...next.layers.slice(at)],
  };
}

/** Draws the shown maps of a list with their opacity and removes the others. */
export async function drawBaseMaps(map: MapLibreMap, maps: readonly BaseMap[], shown: ShownMaps): Promise<void> {
  for (const one of maps) {
    const id = PREFIX + one.name;
    const opacity = shown[one.name];
    if (opacity === undefined || one.url === null) {
      remove(map, id);
      continue;
    }
    if (map.getSource(id) === undefined) await add(map, one, id);
    for (const layer of layersOf(map, id)) setOpacity(map, layer, opacity);
  }
}

async function add(map: MapLibreMap, one: BaseMap, id: string): Promise<void> {
  const url = new URL(one.url ?? "", location.href).href;
  const archive = new PMTiles(url);
  protocol.add(archive);
  const layers = one.kind === "vector_tiles" ? vectorLayers(id, await archive.getMetadata()) : [rasterLayer(id)];
  if (map.getSource(id) !== undefined) return; // Added while the archive was read
  const tiles = { url: `pmtiles://${url}` };
  if (one.kind === "vector_tiles") map.addSource(id, { type: "vector", ...tiles });
  else map.addSource(id, { type: "raster", tileSize: 256, ...tiles });
  for (const layer of layers) map.addLayer(layer, ABOVE);
}

function rasterLayer(id: string): LayerSpecification {
  return { id, type: "raster", source: id };
}

/** Colours of areas and lines by what the name of their layer means; labels would need fonts. */
const MEANINGS: readonly [RegExp, string][] = [
  [/water|ocean|river/, "#9cc4dd"],
  [/building/, "#c9bfb4"],
  [/wood|forest|park|land|green/, "#cfdcc0"],
  [/road|street|transport|highway|path/, "#b59b7c"],
];
const OTHERS = "#c8ccc4";

function vectorLayers(id: string, metadata: unknown): LayerSpecification[] {
  const found = (metadata as { vector_layers?: { id: string }[] } | null)?.vector_layers ?? [];
  const colourOf = (name: string) => MEANINGS.find(([meaning]) => meaning.test(name))?.[1] ?? OTHERS;
  const common = (name: string) => ({ source: id, "source-layer": name });
  const areas = found.map(({ id: name }): LayerSpecification => ({
    ...common(name),
    id: `${id}:${name}:area`,
    type: "fill",
    filter: ["==", ["geometry-type"], "Polygon"],
    paint: { "fill-color": colourOf(name) },
  }));
  const lines = found.map(({ id: name }): LayerSpecification => ({
    ...common(name),
    id: `${id}:${name}:line`,
    type: "line",
    filter: ["==", ["geometry-type"], "LineString"],
    paint: { "line-color": colourOf(name), "line-width": 1.5 },
  }));
  return [...areas, ...lines];
}

function layersOf(map: MapLibreMap, id: string): LayerSpecification[] {
  return map.getStyle().layers.filter((layer) => "source" in layer && layer.source === id);
}

function setOpacity(map: MapLibreMap, { id, type }: LayerSpecification, opacity: number): void {
  map.setPaintProperty(id, `${type}-opacity`, opacity);
}

function remove(map: MapLibreMap, id: string): void {
  if (map.getSource(id) === undefined) return;
  for (const layer of layersOf(map, id)) map.removeLayer(layer.id);
  map.removeSource(id);
}
