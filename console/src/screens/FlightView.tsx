import { Suspense, useEffect, useMemo, useState } from "react";
import { useTranslation } from "react-i18next";
import {
  flightTrack, getFlight, getFlightMap, listFields, listFlightAlarms, listFootprints, listObservations, listPictures,
} from "../api/resources";
import { useUnits } from "../app/preferences";
import { linkTo } from "../app/route";
import { Button } from "../controls/Button";
import { Icon } from "../controls/Icon";
import { Empty, ErrorNotice, Notice, Skeleton } from "../controls/states";
import { kindsOf, measurementFeatures } from "../flights/measurements";
import { momentAt, pointsOf } from "../flights/track";
import { useReplay } from "../flights/use_replay";
import { describeAlarm } from "../i18n/describe_alarm";
import { useReportText } from "../i18n/use_report_text";
import { useResource } from "../live/use_resource";
import type { Symbol } from "../map/FarmMap";
import { extentOf } from "../map/extent";
import { collection, fieldFeatures } from "../map/features";
import { FarmMap } from "../map/map_part";
import { pictureElement, updateVehicleElement, valueElement, vehicleElement } from "../map/markers";
import { picturePlaces, picturesApart_m, placedMap, placedPictures } from "../map/picture_places";
import { FlightLogs } from "./flight/FlightLogs";
import { FlightPlots, type Mark } from "./flight/FlightPlots";
import { Gallery } from "./flight/Gallery";
import { MapLegend, Measurements, nameOf } from "./flight/Measurements";
import { LayerChoice, SurveyMap } from "./flight/PictureMapChoice";
import { FlightSteps } from "./FlightSteps";
import { FlightFigures } from "./Flights";
import { fieldNames } from "./use_fleet_symbols";

const FORMATS = { gpx: "GPX", csv: "CSV", geojson: "GeoJSON" } as const;
/** How often a flight that goes on is loaded again. */
const REFRESH_MS = 4_000;
/** How often it is asked whether a flight that has ended is still in the archive. */
const RECHECK_MS = 30_000;
/** Of the map before it is drawn. */
const FIRST_ZOOM = 18;

/** A recorded flight: its track with a replay, its curves, figures, measurements and pictures. */
export default function FlightView({ id }: { id: number }) {
  const { t } = useTranslation();
  const reportText = useReportText();
  const flight = useResource(() => getFlight(id), id);
  const track = useResource(() => flightTrack(id), id);
  const pictures = useResource(() => listPictures(id), id);
  const footprints = useResource(() => listFootprints(id), id);
  const [pictureOpacity, setPictureOpacity] = useState<number | null>(null);
  const placed = useMemo(
    () => placedPictures(pictures.value ?? [], footprints.value ?? [], "rgb"),
    [pictures.value, footprints.value],
  );
  const hasIndex = useMemo(
    () => placedPictures(pictures.value ?? [], footprints.value ?? [], "ndvi").length > 1,
    [pictures.value, footprints.value],
  );
  const surveyMap = useResource(() => getFlightMap(id, "rgb"), id);
  const [mapOpacity, setMapOpacity] = useState<number | null>(null);
  const indexMap = useResource(() => getFlightMap(id, "ndvi"), id);
  const [indexOpacity, setIndexOpacity] = useState<number | null>(null);
  const picturesOnMap = useMemo(
    () => [
      { placed, opacity: pictureOpacity },
      { placed: surveyMap.value === null ? [] : placedMap(surveyMap.value), opacity: mapOpacity },
      { placed: indexMap.value === null ? [] : placedMap(indexMap.value), opacity: indexOpacity },
    ],
    [placed, pictureOpacity, surveyMap.value, mapOpacity, indexMap.value, indexOpacity],
  );
  const fields = useResource(listFields);
  const observations = useResource(() => listObservations(id), id);
  const alarms = useResource(
    async () => (flight.value === null ? [] : listFlightAlarms(flight.value)),
    `${id} ${flight.value?.alarms ?? 0}`,
  );
  useRefresh(flight.value?.ended_at === null, REFRESH_MS, flight.reload, track.reload, observations.reload);
  useRefresh(flight.value !== null && flight.value.ended_at !== null, RECHECK_MS, flight.reload);
  const points = useMemo(() => pointsOf(track.value), [track.value]);
  const replay = useReplay();
  const kinds = useMemo(() => kindsOf(observations.value ?? []), [observations.value]);
  const [kindName, setKindName] = useState<string | null>(null);
  const [chosen, setChosen] = useState<string | null>(null);
  const [open, setOpen] = useState<number | null>(null);
  const kind = kindName === null ? (kinds[0] ?? null) : (kinds.find((one) => nameOf(one) === kindName) ?? null);

  const units = useUnits();
  const measured = kind?.measurements.find((one) => one.key === chosen) ?? null;
  const measuredText =
    kind && measured && `${units.measured(measured.value, kind.unit)} · ${units.clock(measured.at_ms)}`;

  const present = momentAt(points, replay.part);
  const marks = useMemo(
    (): Mark[] => [
      ...(alarms.value ?? []).map((alarm): Mark => ({
        at_ms: Date.parse(alarm.recorded_at),
        text: describeAlarm(alarm, t, reportText),
        kind: "alarm",
      })),
      ...(flight.value?.command_array ?? []).flatMap((command, index): Mark[] =>
        command.started_at === null
          ? []
          : [{ at_ms: Date.parse(command.started_at), text: t("flights.step", { id: index + 1 }), kind: "step" }],
      ),
    ],
    [alarms.value, flight.value, reportText, t],
  );
  const layers = useMemo(
    () => ({
      fields: fieldFeatures(fields.value ?? []),
      trails: collection(
        points.length < 2
          ? []
          : [{
              type: "Feature",
              properties: {},
              geometry: {
                type: "LineString",
                coordinates: points.map((one) => [one.longitude_deg, one.latitude_deg]),
              },
            }],
      ),
      measurements: measurementFeatures(kind, chosen),
    }),
    [fields.value, points, kind, chosen],
  );
  const [zoom, setZoom] = useState(FIRST_ZOOM);
  const places = useMemo(() => {
    const apart_m = picturesApart_m(pictures.value?.find((one) => one.latitude !== null)?.latitude ?? 0, zoom);
    return picturePlaces(pictures.value ?? [], apart_m);
  }, [pictures.value, zoom]);
  const symbols = useMemo(() => {
    const names: Symbol[] = [
      ...fieldNames(fields.value ?? []),
      ...places.map(({ latitude, longitude, pictures: taken }) => ({
        key: `picture-${taken.map(({ id: number }) => number).join()}`,
        longitude,
        latitude,
        level: 2,
        make: () =>
          pictureElement(
            taken.length === 1
              ? t("flights.picture", { id: taken[0]?.id })
              : t("flights.pictures_near", { id: taken[0]?.id, count: taken.length - 1 }),
            taken.length,
            taken[0]?.thumbnail_url ?? null,
            () => setOpen(taken[0]?.id ?? null),
          ),
      })),
    ];
    if (measured !== null && measuredText !== null) {
      names.push({
        key: `value-${measured.key} ${measuredText}`,
        longitude: measured.longitude_deg,
        latitude: measured.latitude_deg,
        level: 4,
        make: () => valueElement(measuredText),
      });
    }
    if (present === null || flight.value === null) return names;
    const name = t("vehicle.name", { id: flight.value.vehicle_id });
    const { heading_deg } = present;
    return [
      ...names,
      {
        key: "vehicle",
        longitude: present.longitude_deg,
        latitude: present.latitude_deg,
        level: 3,
        make: () => vehicleElement(name, null),
        update: (element: HTMLElement) => updateVehicleElement(element, heading_deg, "flying", false),
      },
    ];
  }, [fields.value, places, flight.value, present?.longitude_deg, present?.latitude_deg, measured, measuredText, t]);
  const extent = useMemo(
    () => extentOf(points.map((one) => [one.longitude_deg, one.latitude_deg] as const)),
    [points],
  );

  if (flight.error?.status === 404) {
    return (
      <Empty isScreen icon="flight" title={t("flights.deleted_title", { id })} text={t("flights.deleted_text")}>
        <a className="button button-plain" {...linkTo("flights")}>
          <Icon name="back" /> {t("flights.title")}
        </a>
      </Empty>
    );
  }
  return (
    <div className="split">
      <div className="split-map">
        <Suspense fallback={<div className="farm-map" />}>
          <FarmMap
            layers={layers}
            symbols={symbols}
            extent={extent}
            label={t("flights.track")}
            pick={setChosen}
            zoomed={setZoom}
            pictures={picturesOnMap}
            legend={kind && <MapLegend kind={kind} />}
          />
        </Suspense>
      </div>
      <section className="split-side">
        <a className="back-link" {...linkTo("flights")}>
          <Icon name="back" /> {t("flights.title")}
        </a>
        <h1>{t("flights.flight", { id })}</h1>
        {flight.value && (
          <p className="muted">
            {[t("vehicle.name", { id: flight.value.vehicle_id }), flight.value.plan_name].filter(Boolean).join(" · ")}
          </p>
        )}
        {(flight.value?.lost_reports ?? 0) > 0 && (
          <Notice kind="info">{t("flights.lost", { count: flight.value?.lost_reports })}</Notice>
        )}
        {flight.error && <ErrorNotice error={flight.error} retry={flight.reload} />}
        {flight.isLoading && flight.value === null && <Skeleton rows={2} />}
        {flight.value && <FlightFigures flight={flight.value} />}
        {points.length > 1 ? (
          <div className="replay">
            <Button
              kind="primary"
              icon={replay.isPlaying ? "pause" : "play"}
              onClick={() => replay.play(!replay.isPlaying)}
            >
              {t(replay.isPlaying ? "flights.pause" : "flights.replay")}
            </Button>
            <input
              type="range"
              min={0}
              max={1}
              step={0.001}
              value={replay.part}
              aria-label={t("flights.position")}
              aria-valuetext={present === null ? undefined : units.clock(present.at_ms)}
              onChange={(event) => replay.show(Number(event.target.value))}
            />
          </div>
        ) : (
          !track.isLoading && <p className="muted">{t("flights.no_track")}</p>
        )}
        <FlightPlots points={points} replay={replay} marks={marks} />
        <div className="actions">
          {(["gpx", "csv", "geojson"] as const).map((format) => (
            <a
              key={format}
              className="button button-plain"
              href={`/flights/${id}/track?format=${format}`}
              download
            >
              <Icon name="download" /> {FORMATS[format]}
            </a>
          ))}
        </div>
        {flight.value && <FlightSteps flight={flight.value} at_ms={replay.part < 1 ? (present?.at_ms ?? null) : null} />}
        <Measurements
          flightId={id}
          resource={observations}
          choice={{ kinds, kind, choose: setKindName, chosen, mark: (one) => setChosen(one.key) }}
        />
        <h2>{t("flights.pictures")}</h2>
        {pictures.value === null || pictures.value.length === 0 ? (
          !pictures.isLoading && <Empty icon="picture" title={t("flights.no_pictures")} />
        ) : (
          <>
            {placed.length > 0 && (
              <LayerChoice
                label={t("flights.pictures_on_map", { count: placed.length })}
                sliderLabel={t("flights.pictures_opacity")}
                opacity={pictureOpacity}
                change={setPictureOpacity}
              />
            )}
            {placed.length > 1 && (
              <SurveyMap flightId={id} band="rgb" resource={surveyMap} opacity={mapOpacity} change={setMapOpacity} />
            )}
            {hasIndex && (
              <SurveyMap flightId={id} band="ndvi" resource={indexMap} opacity={indexOpacity} change={setIndexOpacity} />
            )}
            <Gallery pictures={pictures.value} open={open} show={setOpen} />
          </>
        )}
        {flight.value && <FlightLogs flight={flight.value} />}
      </section>
    </div>
  );
}

/** Loads again while the flight goes on and somebody looks. */
function useRefresh(isNeeded: boolean, every_ms: number, ...reloads: (() => void)[]): void {
  useEffect(() => {
    if (!isNeeded) return;
    const timer = setInterval(() => {
      if (!document.hidden) reloads.forEach((reload) => reload());
    }, every_ms);
    return () => clearInterval(timer);
    // Each reload stays the same function
    // eslint-disable-next-line react-hooks/exhaustive-deps
  }, [isNeeded, every_ms]);
}
