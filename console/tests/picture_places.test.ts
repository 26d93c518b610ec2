import { expect, test } from "vitest";
import type { Footprint, Picture } from "../src/api/types";
import { picturePlaces, placedPictures } from "../src/map/picture_places";

const picture = (id: number, latitude: number | null): Picture => ({
  id, recorded_at: "2026-05-01T10:00:00Z", latitude, longitude: -3.7382, altitude: 20,
  url: `/flights/1/pictures/${id}`, thumbnail_url: null,
});

test("pictures near each other are one symbol, those farther away another", () => {
  const taken = [picture(1, 40.4434), picture(2, 40.443401), picture(3, 40.4436), picture(4, 40.44359)];
  const groups = (apart_m: number) => picturePlaces(taken, apart_m).map((one) => one.pictures.map(({ id }) => id));
  expect(groups(0)).toEqual([[1], [2], [3], [4]]);
  expect(groups(2)).toEqual([[1, 2], [3, 4]]);
  expect(groups(30)).toEqual([[1, 2, 3, 4]]);
  expect(picturePlaces(taken, 2)[1]?.latitude).toBe(40.4436);
});

test("symbols of pictures are never nearer to each other than asked", () => {
  const taken = Array.from({ length: 200 }, (_, index) => picture(index, 40 + 2e-5 * ((index * 37) % 200)));
  const places = picturePlaces(taken, 10).map(({ latitude }) => latitude).sort((one, other) => one - other);
  const gaps_m = places.slice(1).map((latitude, index) => (latitude - (places[index] ?? 0)) * 111_320);
  expect(Math.min(...gaps_m)).toBeGreaterThanOrEqual(10);
});

test("a picture without a place is not on the map", () => {
  expect(picturePlaces([picture(1, null)], 1)).toEqual([]);
});

const small = (id: number): Picture => ({ ...picture(id, 40), thumbnail_url: `/flights/1/pictures/${id}/thumbnail` });
const CORNERS: [number, number][] = [[40.1, -3.2], [40.1, -3.1], [40, -3.1], [40, -3.2]];
const footprint = (id: number, corners: [number, number][] | null = CORNERS): Footprint => ({ id, corners, band: "rgb" });

test("a picture that looks down lies between its corners, longitude first", () => {
  expect(placedPictures([small(1)], [footprint(1)], "rgb")).toEqual([
    { id: 1, url: "/flights/1/pictures/1/thumbnail", corners: [[-3.2, 40.1], [-3.1, 40.1], [-3.1, 40], [-3.2, 40]] },
  ]);
});

test("a picture that is no map, or has no small one, is left out", () => {
  const raw = { ...small(3), thumbnail_url: null };
  const placed = placedPictures([small(1), small(2), raw], [footprint(1, null), footprint(3)], "rgb");
  expect(placed).toEqual([]);
});

test("of very many pictures some are drawn, over the whole flight", () => {
  const ids = Array.from({ length: 1000 }, (_, index) => index + 1);
  const placed = placedPictures(ids.map(small), ids.map((id) => footprint(id)), "rgb");
  expect(placed.length).toBeLessThanOrEqual(300);
  expect(placed.at(-1)?.id).toBeGreaterThan(990);
});

test("pictures of the vegetation index are not drawn among those of colours", () => {
  const footprints: Footprint[] = [footprint(1), { ...footprint(2), band: "ndvi" }];
  const drawn = (band: "rgb" | "ndvi") => placedPictures([small(1), small(2)], footprints, band).map(({ id }) => id);
  expect([drawn("rgb"), drawn("ndvi")]).toEqual([[1], [2]]);
});
