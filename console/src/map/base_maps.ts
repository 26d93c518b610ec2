/** Base maps below everything else: PMTiles archives of the edge server, read a range at a time, and
 *  its GeoTIFFs and its maps of surveys as pictures. */

import type { LayerSpecification, Map as MapLibreMap, StyleSpecification } from "maplibre-gl";
import { PMTiles, Protocol } from "pmtiles";
import type { BaseMap } from "../api/types";
import maplibregl from "./maplibre";
import { layerAbove, stacked } from "./stacking";
import { FIELD_OPACITY } from "./style";

/** Opacity of the base maps that are shown, by name. */
export type ShownMaps = Record<string, number>;

const KEY = "farm-console-maps";
export const PREFIX = "base:";
/** Pictures of a flight, above the base maps. */
export const PICTURES = `${PREFIX}picture-`;
/** Of the fields' areas while something is below them: its colours mean something. The edges stay. */
const COVERED_OPACITY = 0;
/** Base maps lie below this layer. */
export const ABOVE = "field";
const PREPARE_ATTEMPTS = 30;
const PREPARE_MS = 2_000;
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
    layers: [...next.layers.slice(0, at), ...layers, ...next.layers.slice(at)].map((layer) =>
      layer.id === ABOVE && layer.type === "fill" && layers.length > 0
        ? { ...layer, paint: { ...layer.paint, "fill-opacity": COVERED_OPACITY } }
        : layer,
    ),
  };
}

/** Draws the shown maps of a list with their opacity and removes the others.
 *
 * Gives the reasons for those that cannot be drawn, by name. What is aborted draws nothing more.
 */
export async function drawBaseMaps(
  map: MapLibreMap, maps: readonly BaseMap[], shown: ShownMaps, signal: AbortSignal,
): Promise<Record<string, string>> {
  const faults: Record<string, string> = {};
  const all = stacked(maps);
  const order = all.map(({ name }) => PREFIX + name);
  for (const one of all) {
    const id = PREFIX + one.name;
    const opacity = shown[one.name];
    if (opacity === undefined || one.url === null) {
      remove(map, id);
      continue;
    }
    try {
      if (map.getSource(id) === undefined) await add(map, one, id, order, signal);
    } catch (error) {
      faults[one.name] = error instanceof Error ? error.message : String(error);
    }
    if (signal.aborted) break;
    for (const layer of layersOf(map, id)) setOpacity(map, layer, opacity);
  }
  thinFields(map);
  return faults;
}

/** The layer below which a base map lies: of a higher one, or the pictures of a flight. */
function abovePlace(map: MapLibreMap, source: string, order: readonly string[]): string {
  const { layers } = map.getStyle();
  const sources = layers.map((layer) => ({ id: layer.id, source: "source" in layer ? String(layer.source) : undefined }));
  return layerAbove(sources, source, order) ?? layers.find(({ id }) => id.startsWith(PICTURES))?.id ?? ABOVE;
}

/** Shows what lies below the fields in its own colours. */
export function thinFields(map: MapLibreMap): void {
  const isCovered = map.getLayersOrder().some((id) => id.startsWith(PREFIX));
  const opacity = isCovered ? COVERED_OPACITY : FIELD_OPACITY;
  // The same value again would draw the map for the whole time of a transition
  if (map.getPaintProperty(ABOVE, "fill-opacity") === opacity) return;
  map.setPaintProperty(ABOVE, "fill-opacity", opacity);
}

async function add(
  map: MapLibreMap, one: BaseMap, id: string, order: readonly string[], signal: AbortSignal,
): Promise<void> {
  const url = new URL(one.url ?? "", location.href).href;
  if (one.kind === "picture" || one.kind === "vegetation_index") return addPicture(map, one, id, url, order, signal);
  const archive = new PMTiles(url);
  protocol.add(archive);
  const layers = one.kind === "vector_tiles" ? vectorLayers(id, await archive.getMetadata()) : [rasterLayer(id)];
  if (signal.aborted) return;
  const tiles = { url: `pmtiles://${url}` };
  if (one.kind === "vector_tiles") map.addSource(id, { type: "vector", ...tiles });
  else map.addSource(id, { type: "raster", tileSize: 256, ...tiles });
  for (const layer of layers) map.addLayer(layer, abovePlace(map, id, order));
}

async function addPicture(
  map: MapLibreMap, one: BaseMap, id: string, url: string, order: readonly string[], signal: AbortSignal,
): Promise<void> {
  await prepare(url, signal);
  const [northWest, northEast, southEast, southWest] = (one.corners ?? []).map(
    ([latitude, longitude]): [number, number] => [longitude, latitude],
  );
  if (signal.aborted || !northWest || !northEast || !southEast || !southWest) return;
  map.addSource(id, { type: "image", url, coordinates: [northWest, northEast, southEast, southWest] });
  map.addLayer(rasterLayer(id), abovePlace(map, id, order));
}

/** Waits until the edge server has made a picture: a large one takes some seconds, one at a time. */
export async function prepare(url: string, signal: AbortSignal): Promise<void> {
  for (let attempt = 0; ; attempt += 1) {
    const answer = await fetch(url, { signal });
    if (answer.ok) return;
    const { message } = (await answer.json().catch(() => ({}))) as { message?: string };
    if (answer.status !== 429 || attempt >= PREPARE_ATTEMPTS) throw new Error(message ?? `HTTP ${answer.status}`);
    await new Promise((resolve) => setTimeout(resolve, PREPARE_MS));
  }
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
