import { afterEach, expect, test, vi } from "vitest";
import type { BaseMap, MadeFlightMap } from "../src/api/types";
import { layerAbove, stacked } from "../src/map/stacking";
import { asBaseMap, isSurvey, listSurveyMaps, surveyName } from "../src/map/survey_maps";

const file = (name: string, kind: BaseMap["kind"]): BaseMap =>
  ({ name, kind, url: `/maps/${name}`, bounds: null, corners: null, fault: null });
const made = (flight_id: number, band: MadeFlightMap["band"]): MadeFlightMap => ({
  id: flight_id, flight_id, vehicle_id: 2, plan_name: "North field 1", band, url: `/flights/${flight_id}/map/picture?band=${band}`,
  made_at: "2026-05-01T10:00:00Z",
  corners: [[41, -3], [41, -2], [40, -2], [40, -3]], pictures: 9, metres_per_px: 0.05,
});
const survey = (id: number, band: MadeFlightMap["band"] = "rgb") => asBaseMap(made(id, band));

afterEach(() => vi.unstubAllGlobals());

test("pictures lie above tiles, and surveys above both, whatever their names are", () => {
  const maps = [
    survey(12), file("a-orthophoto.tif", "picture"), survey(7, "ndvi"), file("z-tiles.pmtiles", "raster_tiles"),
    survey(7), file("b-index.tif", "vegetation_index"), file("roads.pmtiles", "vector_tiles"), file("broken", null),
  ];
  expect(stacked(maps).map(({ name }) => name)).toEqual([
    "broken", "roads.pmtiles", "z-tiles.pmtiles", "a-orthophoto.tif", "b-index.tif",
    "survey/7/rgb", "survey/7/ndvi", "survey/12/rgb",
  ]);
});

test("a map that is chosen later is drawn below those that lie above it", () => {
  const order = ["tiles", "orthophoto", "survey"];
  const drawn = [{ id: "ground" }, { id: "roads:area", source: "orthophoto" }, { id: "survey", source: "survey" }];
  expect(layerAbove(drawn, "tiles", order)).toBe("roads:area");
  expect(layerAbove(drawn, "orthophoto", order)).toBe("survey");
  expect(layerAbove(drawn, "survey", order)).toBeUndefined();
});

test("a finished map of a survey is a base map between its corners", () => {
  expect(survey(7)).toMatchObject({
    name: "survey/7/rgb", kind: "picture", corners: [[41, -3], [41, -2], [40, -2], [40, -3]],
    survey: { flightId: 7, vehicleId: 2, planName: "North field 1", madeAt: "2026-05-01T10:00:00Z" },
  });
  expect(survey(7, "ndvi").kind).toBe("vegetation_index");
});

test("the names of surveys are told from those of files", () => {
  expect([surveyName(7, "ndvi"), "survey.tif", "survey/x/rgb"].map(isSurvey)).toEqual([true, false, false]);
});

test("the maps of surveys come in one answer, the newest first", async () => {
  const answers: Record<string, unknown> = {
    "/flight_maps/?limit=500&after=0": [made(3, "rgb"), made(7, "rgb"), made(7, "nir"), made(7, "ndvi")],
  };
  vi.stubGlobal("fetch", async (path: string) => new Response(JSON.stringify(answers[path])));
  expect((await listSurveyMaps()).map(({ name }) => name)).toEqual(["survey/7/ndvi", "survey/7/rgb", "survey/3/rgb"]);
});
