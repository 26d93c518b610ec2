/** Where pictures were taken. Pure. */

import type { Picture } from "../api/types";

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
