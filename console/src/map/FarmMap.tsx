import { useEffect, useRef, useState, type ReactNode } from "react";
import { useTranslation } from "react-i18next";
import type { GeoJSONSource, LngLatBoundsLike, Map as MapLibreMap, Marker } from "maplibre-gl";
import { usePreferences } from "../app/preferences";
import { Icon } from "../controls/Icon";
import { Notice } from "../controls/states";
import { keepBaseMaps } from "./base_maps";
import { BaseMaps } from "./BaseMaps";
import { gridOf } from "./grid";
import maplibregl from "./maplibre";
import { drawPictures } from "./picture_map";
import type { PictureLayer } from "./picture_places";
import { offsetsOf } from "./spread";
import { mapStyle, type MapData } from "./style";

/** A symbol on the map; `element` is made once for each key. */
export interface Symbol {
  key: string;
  longitude: number;
  latitude: number;
  /** Moves the symbol below others: 0 is the lowest. */
  level?: number;
  make: () => HTMLElement;
  update?: (element: HTMLElement) => void;
  /** Moves it aside on the screen where it would lie on another one that does the same. */
  isMovedAside?: boolean;
  /** Called while the symbol is dragged; without it the symbol cannot be. */
  drag?: (longitude: number, latitude: number, isDropped: boolean) => void;
}

export interface FarmMapProperties {
  layers: Omit<MapData, "grid">;
  symbols: Symbol[];
  /** What the map shows at first, once it is known: [west, south, east, north]. */
  extent: [number, number, number, number] | null;
  click?: (longitude: number, latitude: number) => void;
  /** Called with the key of a measurement that is pressed. */
  pick?: (key: string) => void;
  /** Called with each new zoom. */
  zoomed?: (zoom: number) => void;
  /** Pictures on the ground that they show, from below to above. */
  pictures?: readonly PictureLayer[];
  /** What the colours on the map mean. */
  legend?: ReactNode;
  label: string;
}

const FIRST_PLACE: [number, number] = [-3.7382, 40.4434];
const CLOSEST_ZOOM = 18;
/** How long the first drawing waits for what says where to look: to draw another place first costs more. */
const AWAITS_EXTENT_MS = 500;
/** What is shown does not lie below the buttons on the left. */
const PADDING = { top: 56, right: 56, bottom: 56, left: 84 };

/** The farm from above: a grid with a scale, and what is drawn on it. */
export default function FarmMap({ layers, symbols, extent, click, pick, zoomed, pictures, legend, label }: FarmMapProperties) {
  const { t } = useTranslation();
  const { preferences } = usePreferences();
  const container = useRef<HTMLDivElement>(null);
  /** Made at once; it has a style and is `map` when it is known what it shows. */
  const bare = useRef<MapLibreMap | null>(null);
  const [map, setMap] = useState<MapLibreMap | null>(null);
  const [hasFailed, setFailed] = useState(false);
  const [hasWaited, setWaited] = useState(false);
  const [styles, setStyles] = useState(0);
  const hasFitted = useRef(false);
  /** What the sources of the present style hold: an unchanged layer is not sent again. */
  const drawn = useRef<FarmMapProperties["layers"]>({});
  const latestLayers = useRef(layers);
  latestLayers.current = layers;
  const latestClick = useRef(click);
  latestClick.current = click;
  const latestPick = useRef(pick);
  latestPick.current = pick;
  const latestZoomed = useRef(zoomed);
  latestZoomed.current = zoomed;

  useEffect(() => {
    if (container.current === null) return;
    let made: MapLibreMap;
    try {
      made = new maplibregl.Map({
        container: container.current,
        center: FIRST_PLACE,
        zoom: 16,
        maxZoom: 21,
        attributionControl: false,
        locale: { "Map.Title": t("map.canvas") },
        dragRotate: false,
        pitchWithRotate: false,
        touchPitch: false,
      });
    } catch {
      setFailed(true); // No WebGL: everything but the map works
      return;
    }
    made.touchZoomRotate.disableRotation();
    made.on("zoomend", () => latestZoomed.current?.(made.getZoom()));
    made.on("style.load", () => setStyles((count) => count + 1));
    made.once("style.load", () => {
      setMap(made);
      latestZoomed.current?.(made.getZoom());
      made.on("moveend", () => drawGrid(made));
    });
    made.on("click", (event) => {
      const key: unknown = made.queryRenderedFeatures(event.point, { layers: ["measurement"] })[0]?.properties["key"];
      if (typeof key === "string" && latestPick.current) latestPick.current(key);
      else latestClick.current?.(event.lngLat.lng, event.lngLat.lat);
    });
    bare.current = made;
    const timer = setTimeout(() => setWaited(true), AWAITS_EXTENT_MS);
    return () => {
      clearTimeout(timer);
      bare.current = null;
      hasFitted.current = false;
      made.remove();
    };
  }, []);

  useEffect(() => {
    const place = container.current;
    place?.addEventListener("pointerdown", leaveField, true);
    return () => place?.removeEventListener("pointerdown", leaveField, true);
  }, []);

  useEffect(() => {
    const made = map ?? bare.current;
    if (made === null) return;
    if (extent !== null && !hasFitted.current) {
      hasFitted.current = true;
      fit(made, extent, 0);
    }
    if (bare.current !== null && (extent !== null || hasWaited)) {
      bare.current = null;
      setStyle(made);
    }
  }, [map, extent, hasWaited]);

  useFitAfterTurning(map, extent);

  useEffect(() => {
    if (map === null) return;
    const scale = new maplibregl.ScaleControl({ unit: preferences.units, maxWidth: 120 });
    map.addControl(scale, "bottom-left");
    return () => {
      if (map.hasControl(scale)) map.removeControl(scale);
    };
  }, [map, preferences.units]);

  useEffect(() => {
    if (map !== null) setStyle(map);
    // The first style has this theme already
    // eslint-disable-next-line react-hooks/exhaustive-deps
  }, [preferences.theme]);

  useEffect(() => {
    if (map === null) return;
    for (const [name, data] of Object.entries(layers)) {
      if (drawn.current[name as keyof typeof layers] === data) continue;
      (map.getSource(name) as GeoJSONSource | undefined)?.setData(data);
    }
    drawn.current = layers;
  }, [map, layers]);

  /** Draws the map in the colours of the present theme, with everything that is known. */
  function setStyle(map: MapLibreMap): void {
    drawn.current = latestLayers.current;
    const style = mapStyle({ ...drawn.current, grid: gridOfView(map) });
    map.setStyle(style, { transformStyle: keepBaseMaps, validate: false }); // Ours: a fault shows in the journeys
  }

  useEffect(() => {
    if (map === null || pictures === undefined) return;
    const control = new AbortController();
    void drawPictures(map, pictures, control.signal);
    return () => control.abort();
  }, [map, styles, pictures]);

  useSymbols(map, symbols);

  return (
    <div className="farm-map" role="region" aria-label={label}>
      <div ref={container} className="farm-map-canvas" />
      {hasFailed && (
        <div className="farm-map-failed">
          <Notice kind="info">{t("map.no_webgl")}</Notice>
        </div>
      )}
      {map && <BaseMaps map={map} styles={styles} />}
      {legend && <div className="map-legend">{legend}</div>}
      {map && (
        <div className="map-tools">
          <button type="button" aria-label={t("map.zoom_in")} onClick={() => map.zoomIn()}>
            <Icon name="add" />
          </button>
          <button type="button" aria-label={t("map.zoom_out")} onClick={() => map.zoomOut()}>
            <span className="minus" />
          </button>
          <button
            type="button"
            aria-label={t("map.show_all")}
            disabled={extent === null}
            onClick={() => extent && fit(map, extent, 400)}
          >
            <Icon name="fit" />
          </button>
        </div>
      )}
    </div>
  );
}

/** Leaves a field in which a person has typed: the keys of undo are then those of the editor. */
function leaveField(): void {
  if (document.activeElement instanceof HTMLInputElement) document.activeElement.blur();
}

function fit(map: MapLibreMap, [west, south, east, north]: [number, number, number, number], duration: number) {
  const bounds: LngLatBoundsLike = [[west, south], [east, north]];
  map.fitBounds(bounds, { padding: PADDING, maxZoom: CLOSEST_ZOOM, duration });
}

/** Shows everything again when a phone is turned, unless a person has moved the map. */
function useFitAfterTurning(map: MapLibreMap | null, extent: FarmMapProperties["extent"]): void {
  const latest = useRef(extent);
  latest.current = extent;
  useEffect(() => {
    if (map === null) return;
    let isMoved = false;
    const moved = (event: { originalEvent?: unknown }) => {
      if (event.originalEvent !== undefined) isMoved = true;
    };
    const turned = () => {
      if (isMoved) return;
      map.resize();
      if (latest.current !== null) fit(map, latest.current, 0);
    };
    const orientation = window.matchMedia("(orientation: portrait)");
    map.on("movestart", moved);
    orientation.addEventListener("change", turned);
    return () => {
      map.off("movestart", moved);
      orientation.removeEventListener("change", turned);
    };
  }, [map]);
}

function drawGrid(map: MapLibreMap): void {
  (map.getSource("grid") as GeoJSONSource | undefined)?.setData(gridOfView(map));
}

function gridOfView(map: MapLibreMap): GeoJSON.FeatureCollection {
  const bounds = map.getBounds();
  return gridOf({
    west: bounds.getWest(),
    south: bounds.getSouth(),
    east: bounds.getEast(),
    north: bounds.getNorth(),
  });
}

/** Wider than the symbol of a step [px]. */
const APART_PX = 34;

function moveSymbolsAside(map: MapLibreMap, entries: readonly { marker: Marker; symbol: Symbol }[]): void {
  const markers = entries.filter(({ symbol }) => symbol.isMovedAside).map(({ marker }) => marker);
  const offsets = offsetsOf(markers.map((marker) => map.project(marker.getLngLat())), APART_PX);
  markers.forEach((marker, index) => {
    const { x, y } = offsets[index] ?? { x: 0, y: 0 };
    const before = marker.getOffset();
    if (before.x !== x || before.y !== y) marker.setOffset([x, y]);
  });
}

/** Keeps one marker for each symbol, moved and not made again. */
function useSymbols(map: MapLibreMap | null, symbols: Symbol[]): void {
  const markers = useRef(new Map<string, { marker: Marker; symbol: Symbol }>());
  /** Key of the symbol that is dragged. */
  const dragged = useRef<string | null>(null);
  useEffect(() => {
    if (map === null) return;
    const moveAside = () => moveSymbolsAside(map, [...markers.current.values()]);
    map.on("zoomend", moveAside);
    return () => {
      map.off("zoomend", moveAside);
    };
  }, [map]);
  useEffect(() => {
    const present = markers.current;
    if (map === null) return;
    const wanted = new Set(symbols.map((symbol) => symbol.key));
    for (const [key, { marker }] of present) {
      if (wanted.has(key)) continue;
      marker.remove();
      present.delete(key);
      if (dragged.current === key) dragged.current = null;
    }
    for (const symbol of symbols) {
      const known = present.get(symbol.key);
      if (known) {
        known.symbol = symbol;
        const { lng, lat } = known.marker.getLngLat(); // Where a person has dragged it, perhaps
        if (lng !== symbol.longitude || lat !== symbol.latitude) {
          known.marker.setLngLat([symbol.longitude, symbol.latitude]);
        }
        const element = known.marker.getElement();
        element.style.zIndex = String(symbol.level ?? 0);
        symbol.update?.(element);
        continue;
      }
      const element = symbol.make();
      element.style.zIndex = String(symbol.level ?? 0);
      symbol.update?.(element);
      const marker = new maplibregl.Marker({ element, draggable: symbol.drag !== undefined })
        .setLngLat([symbol.longitude, symbol.latitude])
        .addTo(map);
      const entry = { marker, symbol };
      present.set(symbol.key, entry);
      marker.on("dragstart", () => marker.setOffset([0, 0])); // It is dropped where it is seen
      for (const kind of ["drag", "dragend"] as const) {
        marker.on(kind, () => {
          dragged.current = kind === "drag" ? symbol.key : null;
          const place = marker.getLngLat();
          entry.symbol.drag?.(place.lng, place.lat, kind === "dragend");
        });
      }
    }
    // What is dragged stays below the pointer
    if (dragged.current === null) moveSymbolsAside(map, [...present.values()]);
  }, [map, symbols]);
  useEffect(() => {
    const present = markers.current;
    return () => {
      for (const { marker } of present.values()) marker.remove();
      present.clear();
    };
  }, [map]);
}
