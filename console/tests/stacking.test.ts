import { afterEach, expect, test, vi } from "vitest";
import type { BaseMap, Flight, FlightMap } from "../src/api/types";
import { layerAbove, stacked } from "../src/map/stacking";
import { asBaseMap, listSurveyMaps, surveyFlights, surveyName, surveysOf } from "../src/map/survey_maps";

const file = (name: string, kind: BaseMap["kind"]): BaseMap =>
  ({ name, kind, url: `/maps/${name}`, bounds: null, corners: null, fault: null });
const made = (band: FlightMap["band"]): FlightMap => ({
  band, state: "ready", reason: null, url: `/flights/7/map/picture?band=${band}`, made_at: "2026-05-01T10:00:00Z",
  corners: [[41, -3], [41, -2], [40, -2], [40, -3]], pictures: 9, metres_per_px: 0.05,
});
const none: FlightMap = { ...made("rgb"), state: "none", url: null, made_at: null, corners: null };
const survey = (id: number, band: FlightMap["band"] = "rgb") => asBaseMap(id, made(band)) as BaseMap;

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
    survey: { flightId: 7, madeAt: "2026-05-01T10:00:00Z" },
  });
  expect(survey(7, "ndvi").kind).toBe("vegetation_index");
  expect(asBaseMap(7, none)).toBeNull();
});

test("the names of surveys are told from those of files", () => {
  expect(surveysOf([surveyName(7, "ndvi"), "survey.tif", "survey/x/rgb"])).toEqual([{ flightId: 7, band: "ndvi" }]);
});

test("the newest flights with pictures may have a map", () => {
  const flights = Array.from({ length: 50 }, (_, index) => ({ id: 50 - index, pictures: index % 2 === 0 ? 1 : 9 }) as Flight);
  expect(surveyFlights(flights)).toEqual(Array.from({ length: 20 }, (_, index) => 49 - 2 * index));
});

test("only what is shown is asked for before somebody chooses", async () => {
  const asked: string[] = [];
  const answers: Record<string, unknown> = {
    "/flights/7/map?band=rgb": made("rgb"), "/flights/7/map?band=ndvi": none, "/flights/?limit=500&after=0": [{ id: 7, pictures: 9 }],
  };
  vi.stubGlobal("fetch", async (path: string) => {
    asked.push(path);
    return path in answers ? new Response(JSON.stringify(answers[path])) : new Response("{}", { status: 404 });
  });
  expect((await listSurveyMaps(["survey/7/rgb", "survey/3/rgb", "Aerial.pmtiles"], false)).map(({ name }) => name))
    .toEqual(["survey/7/rgb"]);
  expect(asked).toEqual(["/flights/7/map?band=rgb", "/flights/3/map?band=rgb"]);
  expect((await listSurveyMaps(["survey/7/rgb"], true)).map(({ name }) => name)).toEqual(["survey/7/rgb"]);
});
