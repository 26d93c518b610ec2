import { expect, test } from "vitest";
import type { Picture } from "../src/api/types";
import { picturePlaces } from "../src/map/picture_places";

const picture = (id: number, latitude: number | null): Picture => ({
  id, recorded_at: "2026-05-01T10:00:00Z", latitude, longitude: -3.7382, altitude: 20,
  url: `/flights/1/pictures/${id}`, thumbnail_url: null,
});

test("pictures of one place are one symbol, those of another place another", () => {
  const places = picturePlaces([picture(1, 40.4434), picture(2, 40.443401), picture(3, 40.4436)]);
  expect(places.map((one) => one.pictures.map(({ id }) => id))).toEqual([[1, 2], [3]]);
  expect(places[1]?.latitude).toBe(40.4436);
});

test("a picture without a place is not on the map", () => {
  expect(picturePlaces([picture(1, null)])).toEqual([]);
});
