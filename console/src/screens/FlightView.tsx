import { lazy, Suspense, useEffect, useMemo, useState } from "react";
import { useTranslation } from "react-i18next";
import { flightTrack, getFlight, listFields, listPictures } from "../api/resources";
import { linkTo } from "../app/route";
import { Button } from "../controls/Button";
import { Icon } from "../controls/Icon";
import { Empty, ErrorNotice, Skeleton } from "../controls/states";
import { useResource } from "../live/use_resource";
import { extentOf } from "../map/extent";
import { collection, fieldFeatures } from "../map/features";
import { pictureElement, updateVehicleElement, vehicleElement } from "../map/markers";
import { picturePlaces } from "../map/picture_places";
import { FlightSteps } from "./FlightSteps";
import { FlightFigures } from "./Flights";
import { fieldNames } from "./use_fleet_symbols";

const FarmMap = lazy(() => import("../map/FarmMap"));
const FORMATS = { gpx: "GPX", csv: "CSV", geojson: "GeoJSON" } as const;
const REPLAY_MS = 20_000;
const FRAME_MS = 50;

type Place = readonly [longitude: number, latitude: number];

/** A recorded flight: its track with a replay, its figures and its pictures. */
export default function FlightView({ id }: { id: number }) {
  const { t } = useTranslation();
  const flight = useResource(() => getFlight(id), id);
  const track = useResource(() => flightTrack(id), id);
  const pictures = useResource(() => listPictures(id), id);
  const fields = useResource(listFields);
  const places = useMemo(() => placesOf(track.value), [track.value]);
  const [part, setPart] = useState(1);
  const [isPlaying, setPlaying] = useReplay(part, setPart);

  const present = placeAt(places, part);
  const layers = useMemo(
    () => ({
      fields: fieldFeatures(fields.value ?? []),
      trails: collection(
        places.length < 2
          ? []
          : [{ type: "Feature", properties: {}, geometry: { type: "LineString", coordinates: places.map(([x, y]) => [x, y]) } }],
      ),
    }),
    [fields.value, places],
  );
  const symbols = useMemo(() => {
    const names = [
      ...fieldNames(fields.value ?? []),
      ...picturePlaces(pictures.value ?? []).map(({ latitude, longitude, pictures: taken }) => ({
        key: `picture-${taken[0]?.id}`,
        longitude,
        latitude,
        level: 2,
        make: () =>
          pictureElement(
            taken.map(({ id: number }) => t("flights.picture", { id: number })).join(", "),
            taken[0]?.url ?? "",
          ),
      })),
    ];
    if (present === null || flight.value === null) return names;
    const name = t("vehicle.name", { id: flight.value.vehicle_id });
    const { place, heading_deg } = present;
    return [
      ...names,
      {
        key: "vehicle",
        longitude: place[0],
        latitude: place[1],
        level: 3,
        make: () => vehicleElement(name, () => undefined),
        update: (element: HTMLElement) => updateVehicleElement(element, heading_deg, "flying", false),
      },
    ];
  }, [fields.value, pictures.value, flight.value, present?.place[0], present?.place[1], t]);
  const extent = useMemo(() => extentOf(places), [places]);

  return (
    <div className="split">
      <div className="split-map">
        <Suspense fallback={<div className="farm-map" />}>
          <FarmMap layers={layers} symbols={symbols} extent={extent} label={t("flights.track")} />
        </Suspense>
      </div>
      <section className="split-side">
        <a className="back-link" {...linkTo("flights")}>
          <Icon name="back" /> {t("flights.title")}
        </a>
        <h1>{t("flights.flight", { id })}</h1>
        {flight.error && <ErrorNotice error={flight.error} retry={flight.reload} />}
        {flight.isLoading && flight.value === null && <Skeleton rows={2} />}
        {flight.value && <FlightFigures flight={flight.value} />}
        {places.length > 1 ? (
          <div className="replay">
            <Button
              kind="primary"
              icon={isPlaying ? "pause" : "play"}
              onClick={() => setPlaying(!isPlaying)}
            >
              {t(isPlaying ? "flights.pause" : "flights.replay")}
            </Button>
            <input
              type="range"
              min={0}
              max={1}
              step={0.001}
              value={part}
              aria-label={t("flights.position")}
              onChange={(event) => {
                setPlaying(false);
                setPart(Number(event.target.value));
              }}
            />
          </div>
        ) : (
          !track.isLoading && <p className="muted">{t("flights.no_track")}</p>
        )}
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
        {flight.value && <FlightSteps flight={flight.value} />}
        <h2>{t("flights.pictures")}</h2>
        {pictures.value === null || pictures.value.length === 0 ? (
          !pictures.isLoading && <Empty icon="picture" title={t("flights.no_pictures")} />
        ) : (
          <div className="pictures">
            {pictures.value.map((picture) => (
              <a key={picture.id} href={picture.url} target="_blank" rel="noreferrer">
                <img
                  src={picture.thumbnail_url ?? picture.url}
                  alt={t("flights.picture", { id: picture.id })}
                  loading="lazy"
                />
              </a>
            ))}
          </div>
        )}
      </section>
    </div>
  );
}

/** Moves the part from 0 to 1 while it plays. */
function useReplay(
  part: number,
  setPart: (change: (part: number) => number) => void,
): [boolean, (isPlaying: boolean) => void] {
  const [isPlaying, setPlaying] = useState(false);
  useEffect(() => {
    if (!isPlaying) return;
    const timer = setInterval(() => setPart((now) => Math.min(1, now + FRAME_MS / REPLAY_MS)), FRAME_MS);
    return () => clearInterval(timer);
  }, [isPlaying, setPart]);
  const hasEnded = part >= 1;
  useEffect(() => {
    if (hasEnded) setPlaying(false);
  }, [hasEnded]);
  return [
    isPlaying,
    (wanted) => {
      if (wanted && hasEnded) setPart(() => 0);
      setPlaying(wanted);
    },
  ];
}

function placesOf(track: GeoJSON.FeatureCollection | GeoJSON.Feature | null): Place[] {
  if (track === null) return [];
  const features = track.type === "FeatureCollection" ? track.features : [track];
  return features.flatMap(({ geometry }) =>
    geometry?.type === "LineString"
      ? geometry.coordinates.map(([x = 0, y = 0]): Place => [x, y])
      : [],
  );
}

/** The place at a part of the track, between its points; null without a track. */
function placeAt(places: Place[], part: number): { place: Place; heading_deg: number } | null {
  if (places.length < 2) return null;
  const at = Math.min(part * (places.length - 1), places.length - 1.001);
  const index = Math.floor(at);
  const one = places[index];
  const next = places[index + 1];
  if (one === undefined || next === undefined) return null;
  const between = (axis: 0 | 1) => one[axis] + (next[axis] - one[axis]) * (at - index);
  const east = (next[0] - one[0]) * Math.cos((one[1] * Math.PI) / 180);
  const heading_deg = (Math.atan2(east, next[1] - one[1]) * 180) / Math.PI;
  return { place: [between(0), between(1)], heading_deg };
}
