/** Where pictures were taken, and what ground they show. Pure. */

import type { Band, FlightMap, Footprint, Picture } from "../api/types";

/** A place with the pictures that were taken there, the oldest first. */
export interface PicturePlace {
  latitude: number;
  longitude: number;
  pictures: Picture[];
}

const DIGITS = 5;

/** Groups pictures by their place, to a metre; those without a place are left out. */
export function picturePlaces(pictures: readonly Picture[]): PicturePlace[] {
  const places = new Map<string, PicturePlace>();
  for (const picture of pictures) {
    const { latitude, longitude } = picture;
    if (typeof latitude !== "number" || typeof longitude !== "number") continue;
    const key = `${latitude.toFixed(DIGITS)},${longitude.toFixed(DIGITS)}`;
    const known = places.get(key);
    if (known) known.pictures.push(picture);
    else places.set(key, { latitude, longitude, pictures: [picture] });
  }
  return [...places.values()];
}

/** Pictures that are drawn with one opacity; null draws none. */
export interface PictureLayer {
  placed: readonly PlacedPicture[];
  opacity: number | null;
}

/** Places the map of a survey; nothing while there is none. */
export function placedMap({ url, corners }: Pick<FlightMap, "url" | "corners">): PlacedPicture[] {
  const [first, second, third, fourth] = (corners ?? []).map(([latitude, longitude]): Place => [longitude ?? 0, latitude ?? 0]);
  if (url === null || !first || !second || !third || !fourth) return [];
  return [{ id: url, url, corners: [first, second, third, fourth] }];
}

type Place = [longitude: number, latitude: number];

/** A picture and its corners, from the top left on clockwise. */
export interface PlacedPicture {
  id: number | string;
  url: string;
  corners: [Place, Place, Place, Place];
}

/** What is drawn: more would be too much for a phone. */
const MOST = 300;

/** Places the pictures of a band that look down; of very many, some at equal distances. */
export function placedPictures(
  pictures: readonly Picture[], footprints: readonly Footprint[], band: Band,
): PlacedPicture[] {
  const ofBand = footprints.filter((one) => one.band === band);
  const corners = new Map(ofBand.map((one) => [one.id, one.corners]));
  const placed = pictures.flatMap(({ id, thumbnail_url: url }): PlacedPicture[] => {
    const [first, second, third, fourth] = (corners.get(id) ?? []).map(
      ([latitude, longitude]): Place => [longitude, latitude],
    );
    if (!url || !first || !second || !third || !fourth) return [];
    return [{ id, url, corners: [first, second, third, fourth] }];
  });
  const step = Math.max(1, Math.ceil(placed.length / MOST));
  return placed.filter((_, index) => index % step === 0);
}
