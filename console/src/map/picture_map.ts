/** The pictures of a flight that look down, each on the ground that it shows: a map without seams removed. */

import type { Map as MapLibreMap } from "maplibre-gl";
import { ABOVE, PICTURES, prepare, thinFields } from "./base_maps";
import type { PlacedPicture } from "./picture_places";

/** Draws the pictures one after the other; null removes them. */
export async function drawPictures(
  map: MapLibreMap, pictures: readonly PlacedPicture[], opacity: number | null, signal: AbortSignal,
): Promise<void> {
  const wanted = new Set(opacity === null ? [] : pictures.map(({ id }) => `${PICTURES}${id}`));
  for (const { id } of map.getStyle().layers.filter((layer) => layer.id.startsWith(PICTURES))) {
    if (wanted.has(id)) {
      map.setPaintProperty(id, "raster-opacity", opacity);
    } else {
      map.removeLayer(id);
      map.removeSource(id);
    }
  }
  thinFields(map);
  if (opacity === null) return;
  for (const { id, url, corners } of pictures) {
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
