/** The pictures of a flight that look down, each on the ground that it shows, and the map made of them. */

import type { Map as MapLibreMap } from "maplibre-gl";
import { ABOVE, PICTURES, prepare, thinFields } from "./base_maps";
import type { PictureLayer } from "./picture_places";

/** Draws the pictures of the layers one after the other, and removes all others. */
export async function drawPictures(
  map: MapLibreMap, pictureLayers: readonly PictureLayer[], signal: AbortSignal,
): Promise<void> {
  const shown = pictureLayers.flatMap(({ placed, opacity }) =>
    opacity === null ? [] : placed.map((one) => ({ ...one, opacity })),
  );
  const wanted = new Map(shown.map(({ id, opacity }) => [`${PICTURES}${id}`, opacity]));
  for (const { id } of map.getStyle().layers.filter((layer) => layer.id.startsWith(PICTURES))) {
    if (wanted.has(id)) {
      map.setPaintProperty(id, "raster-opacity", wanted.get(id));
    } else {
      map.removeLayer(id);
      map.removeSource(id);
    }
  }
  thinFields(map);
  for (const { id, url, corners, opacity } of shown) {
    const name = `${PICTURES}${id}`;
    if (map.getSource(name) !== undefined) continue;
    const isReadable = await prepare(new URL(url, location.href).href, signal).then(() => true, () => false);
    if (signal.aborted) return;
    if (!isReadable) continue;
    map.addSource(name, { type: "image", url, coordinates: corners });
    map.addLayer({ id: name, type: "raster", source: name, paint: { "raster-opacity": opacity, "raster-fade-duration": 0 } }, ABOVE);
    thinFields(map);
  }
}
