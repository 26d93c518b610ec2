/** Where pictures were taken, and what ground they show. Pure. */

import type { Band, FlightMap, Footprint, Picture } from "../api/types";

/** A place with the pictures that were taken there or near it, the oldest first. */
export interface PicturePlace {
  latitude: number;
  longitude: number;
  pictures: Picture[];
}

/** Groups pictures so that their places are so far from each other at least [m]; those without a place are left out. */
export function picturePlaces(pictures: readonly Picture[], apart_m: number): PicturePlace[] {
  const places: PicturePlace[] = [];
  for (const picture of pictures) {
    const { latitude, longitude } = picture;
    if (typeof latitude !== "number" || typeof longitude !== "number") continue;
    const near = places.find((place) => distance_m(place, { latitude, longitude }) < apart_m);
    if (near) near.pictures.push(picture);
    else places.push({ latitude, longitude, pictures: [picture] });
  }
  return places;
}

/** Symbols of pictures are so far from each other at least: a finger presses one alone [px]. */
const APART_PX = 44;
const EQUATOR_M = 40_075_017;
const TILE_PX = 512;

/** How far from each other the places of pictures have to be at a zoom of the map [m]. */
export function picturesApart_m(latitude_deg: number, zoom: number): number {
  return (APART_PX * EQUATOR_M * Math.cos((latitude_deg * Math.PI) / 180)) / (TILE_PX * 2 ** zoom);
}

const METRES_PER_DEGREE = 111_320;

/** On a plane: pictures of one flight. */
function distance_m(one: { latitude: number; longitude: number }, other: { latitude: number; longitude: number }): number {
  const narrowing = Math.cos((one.latitude * Math.PI) / 180);
  return METRES_PER_DEGREE * Math.hypot(one.latitude - other.latitude, (one.longitude - other.longitude) * narrowing);
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
